"""HOT, Figure 4: a ball pushes a metal box down between two soft ones, until it tears off."""

from ..common.state_panels import SceneView, scene_scale, states

NEEDS = ["hot.scenes.boxes"]
LOOK = SceneView((0, 3, 5, 9), ("#e07a5f", "#e07a5f", "#8d99ae"), high=(3.2, 4.35, 2.3))


def scale(results):
    return scene_scale(results, "boxes")


def draw(results):
    return states(results, "boxes", LOOK)
