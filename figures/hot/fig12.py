"""HOT, Figure 12: a metal wheel is crushed. Colour: Frobenius norm of the Kirchhoff stress."""

from ..common.state_panels import Look, said, states

NEEDS = ["hot.scenes.wheel"]
LOOK = Look((0, 4, 8, 12), ("plasma",), scalar=("stress", 1e-6, "stress [MPa]"),
            low=(-0.4, 1.09, -0.25), high=(0.4, 1.87, 0.25))


def scale(results):
    return said(results, "wheel")


def draw(results):
    return states(results, "wheel", LOOK)
