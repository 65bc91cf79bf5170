"""LDM, Figure 8: position error of the cylinder under gravity by latent dimension, all points; with
the error of the nearest states of the learned map, and of POD of the same dimension.
"""

from ..common.schemes import curves
from ..common.style import shared_scale

NEEDS = ["ldm.fig8"]
NEAREST = ("nearest", "nearest state, no dynamics", "k:")


def scale(results):
    return shared_scale(results, NEEDS[0])


def draw(results):
    return curves(results.table(NEEDS[0], "errors"), "r", "latent dimension r", "-", (NEAREST,))
