"""HOT, Figure 10: a chain of soft and stiff rings is pulled, and turned until it breaks."""

from ..common.state_panels import SceneView, scene_scale, states

NEEDS = ["hot.scenes.chain"]
LOOK = SceneView((0, 3, 5, 9), ("#e8a33d", "#3b5ba5"), columns=2, low=(0.3, 1.0, 1.0),
            high=(3.9, 1.6, 1.6))


def scale(results):
    return scene_scale(results, "chain")


def draw(results):
    return states(results, "chain", LOOK)
