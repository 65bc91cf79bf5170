"""HOT, Figure 1: four soft pillars with a stiff ball in each are twisted and pulled."""

from ..common.state_panels import SceneView, scene_scale, states

NEEDS = ["hot.scenes.twist"]
LOOK = SceneView((0, 2, 4, 6), ("#e8a33d", "#3b5ba5"))


def scale(results):
    return scene_scale(results, "twist")


def draw(results):
    return states(results, "twist", LOOK)
