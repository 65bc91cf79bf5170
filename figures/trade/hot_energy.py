"""Whole runs of the twisted bar with a stiff middle, by method and tolerance: kinetic energy at the
end over that of a run that is nearly exact, and how far the particles are from there for the time
that the run took. Large marks: the paper's tolerance, 1e-7. Open marks: solves that stop at an
error of displacement of a hundredth and a thousandth of a cell in each step.
"""

import matplotlib.pyplot as plt

from ..common.style import legend_below, scales, series
from ..hot.fig20 import METHODS as PAPERS
from .hot import PAPER

NEEDS = ["trade.hot.energy"]
METHODS = {**PAPERS, "hot-plus": ("HOT-plus", "P-")}


def scale(results):
    return scales(results, NEEDS[0])


def draw(results):
    table = results.table(NEEDS[0], "ends")
    answer = table["eps"].argmin()
    figure, axes = plt.subplots(1, 2, figsize=(7.0, 3.4))
    shown, controlled = table["eps"] > table["eps"][answer], table["cells"] > 0.0
    for (method,), rows in series(table, ("method",)).items():
        by_gradient, by_displacement = rows & shown & ~controlled, rows & controlled
        label, style = METHODS[method]
        colour = {"color": f"C{list(METHODS).index(method)}"}
        share = table["kinetic"] / table["kinetic"][answer]
        for ax, x, y in ((axes[0], table["eps"], share), (axes[1], table["cpu"], table["rms"])):
            ax.plot(x[by_gradient], y[by_gradient], style, ms=4, label=label, **colour)
            printed = by_gradient & (table["eps"] == PAPER)
            ax.plot(x[printed], y[printed], style[0], ms=9, **colour)
        axes[1].plot(table["cpu"][by_displacement], table["rms"][by_displacement], style[0], ms=7,
                     mfc="none", **colour)
    axes[0].axhline(1.0, color="0.7", lw=1, zorder=0)
    axes[0].set(xscale="log", xlabel="tolerance", ylabel="kinetic energy / nearly exact")
    axes[0].invert_xaxis()
    axes[1].set(xscale="log", yscale="log", xlabel="CPU time of the solves [s]",
                ylabel="particles off by, rms [cells]")
    legend_below(figure, axes)
    return figure
