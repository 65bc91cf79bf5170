"""HOT, Figure 12: a metal wheel is crushed. Colour: Frobenius norm of the Kirchhoff stress."""

from ..common.state_panels import SceneView, scene_scale, states

NEEDS = ["hot.scenes.wheel"]
LOOK = SceneView((0, 4, 8, 12), ("plasma",), scalar=("stress", 1e-6, "stress [MPa]"),
            low=(-0.4, 1.09, -0.25), high=(0.4, 1.87, 0.25))


def scale(results):
    return scene_scale(results, "wheel")


def draw(results):
    return states(results, "wheel", LOOK)
