"""HOT, Figure 16: the first step of the soft bust by every method. Residual by iterations and by
CPU time, and, which the paper does not show, the particles' error by CPU time: ADMM's residual
meets the tolerance (dashed) long before its error meets that of the others.
"""

import matplotlib.pyplot as plt

from ..common.method_curves import draw_methods
from ..common.style import legend_below, shared_scale

NEEDS = ["hot.fig16"]
METHODS = ("hot", "hot-quadratic", "lbfgs-h", "lbfgs-gmg", "admm", "pn-pcg", "pn-pcg-mf",
           "pn-mgpcg", "pn-gmg-pcg", "sgs-pcg")
PANELS = (("iteration", "residual"), ("cpu", "residual"), ("cpu", "error"))


def scale(results):
    return shared_scale(results, NEEDS[0])


def draw(results):
    table = results.table(NEEDS[0], "iterates")
    figure, axes = plt.subplots(1, 3, figsize=(7.0, 3.4))
    for ax, columns in zip(axes, PANELS, strict=True):
        draw_methods(ax, table, columns, METHODS)
    axes[0].set_xscale("symlog", linthresh=10.0)
    legend_below(figure, axes, columns=5)
    return figure
