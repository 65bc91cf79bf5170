"""HOT, Figure 5: grains fall onto boards of different stiffness."""

from ..common.state_panels import SceneView, scene_scale, states

NEEDS = ["hot.scenes.boards"]
LOOK = SceneView((0, 1, 3, 12), ("#e9c46a", "#457b9d", "#2a9d8f", "#8ab17d", "#e76f51"))


def scale(results):
    return scene_scale(results, "boards")


def draw(results):
    return states(results, "boards", LOOK)
