"""HOT, Figure 17: one step of the metal wheel while it is crushed. Residual by iterations and by
CPU time at the paper's tolerance (dashed, top), and on the way to smaller ones (bottom).
"""

import matplotlib.pyplot as plt

from ..common.method_curves import EPS, draw_methods
from ..common.style import legend_below, shared_scale

NEEDS = ["hot.fig17"]
METHODS = ("hot", "lbfgs-h", "pn-pcg", "pn-pcg-mf", "pn-mgpcg", "pn-mgpcg-flexible")


def scale(results):
    return shared_scale(results, NEEDS[0])


def draw(results):
    table = results.table(NEEDS[0], "iterates")
    figure, axes = plt.subplots(2, 2, figsize=(7.0, 6.2))
    for row, eps in zip(axes, (EPS, table["eps"].min()), strict=True):
        for ax, x in zip(row, ("iteration", "cpu"), strict=True):
            draw_methods(ax, table, (x, "residual"), METHODS, table["eps"] == eps)
            ax.set_title(f"tolerance {eps:.0e}")
    for ax in axes[1]:
        ax.set_xscale("log")
    legend_below(figure, axes.flat, columns=3)
    return figure
