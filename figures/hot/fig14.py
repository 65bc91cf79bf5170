"""HOT, Figure 14: sauce is poured onto a turkey."""

from ..common.state_panels import SceneView, scene_scale, states

NEEDS = ["hot.scenes.sauce"]
LOOK = SceneView((0, 1, 3, 12), ("#b5302a",), turn=155.0,
                 low=(2.2, 2.97, 2.2), high=(3.7, 4.3, 3.6))


def scale(results):
    return scene_scale(results, "sauce")


def draw(results):
    return states(results, "sauce", LOOK)
