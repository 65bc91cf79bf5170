"""LDM, Figure 9: position error of the cylinder under gravity by number of sample points, r = 4;
all random draws, and POD with as many points.
"""

from ..common.schemes import curves
from ..common.style import shared_scale

NEEDS = ["ldm.fig9"]


def scale(results):
    return shared_scale(results, NEEDS[0])


def draw(results):
    figure = curves(results.table(NEEDS[0], "errors"), "points", "sample points")
    figure.axes[0].set_xscale("log")
    return figure
