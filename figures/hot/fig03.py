"""HOT, Figure 3: a soft armadillo and a stiff cat on a trampoline."""

from ..common.state_panels import SceneView, scene_scale, states

NEEDS = ["hot.scenes.armacat"]
LOOK = SceneView((0, 2, 4, 7), ("#6aa84f", "#4f81bd", "#e0a030"), lift=22.0)


def scale(results):
    return scene_scale(results, "armacat")


def draw(results):
    return states(results, "armacat", LOOK)
