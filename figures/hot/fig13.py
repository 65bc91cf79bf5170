"""HOT, Figure 13: balls bend the metal bars that hold a soft ring between them."""

from ..common.state_panels import SceneView, scene_scale, states

NEEDS = ["hot.scenes.donut"]
LOOK = SceneView((0, 4, 8, 12), ("#e56b8a", "#8d99ae", "#8d99ae"), low=(1.58, 2.72, 1.78),
            high=(2.42, 3.78, 2.22))


def scale(results):
    return scene_scale(results, "donut")


def draw(results):
    return states(results, "donut", LOOK)
