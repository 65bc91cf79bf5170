"""HOT, Figure 2: stiff cats are smashed onto sheets of aluminium and of softer metals, whose
Young's modulus is a tenth, a hundredth and a thousandth, from left to right.
"""

from ..common.state_panels import SceneView, scene_scale, states

NEEDS = ["hot.scenes.aluminium"]
LOOK = SceneView((0, 6, 12), ("#8d99ae", "#5c8fb5", "#3fa796", "#8cc084", "#e0a030"), turn=15.0,
            lift=24.0, columns=1, show_prescribed=False)


def scale(results):
    return scene_scale(results, "aluminium")


def draw(results):
    return states(results, "aluminium", LOOK)
