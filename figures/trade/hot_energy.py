"""Whole runs of the twisted bar with a stiff middle, by method and tolerance: kinetic energy at the
end over that of a run that is nearly exact, and how far the particles are from there for the time
that the run took. Large marks: the paper's tolerance, 1e-7. Open marks: solves that hold an error
of displacement, a hundredth and a thousandth of a cell in each step.
"""

import matplotlib.pyplot as plt

from ..common.orders import legend_below, scales, series
from ..hot.fig20 import METHODS as PAPERS
from .hot import PAPER

NEEDS = ["trade.hot.energy"]
METHODS = {**PAPERS, "hot-plus": ("HOT-plus", "P-")}


def scale(results):
    return scales(results, NEEDS[0])


def draw(results):
    table = results.table(NEEDS[0], "ends")
    answer = table["eps"].argmin()
    figure, axes = plt.subplots(1, 2, figsize=(8.4, 3.4))
    shown, held = table["eps"] > table["eps"][answer], table["cells"] > 0.0
    for (method,), rows in series(table, ("method",)).items():
        own, kept = rows & shown & ~held, rows & held
        label, style = METHODS[method]
        look = {"color": f"C{list(METHODS).index(method)}"}
        share = table["kinetic"] / table["kinetic"][answer]
        for ax, x, y in ((axes[0], table["eps"], share), (axes[1], table["cpu"], table["rms"])):
            ax.plot(x[own], y[own], style, ms=4, label=label, **look)
            at = own & (table["eps"] == PAPER)
            ax.plot(x[at], y[at], style[0], ms=9, **look)
        axes[1].plot(table["cpu"][kept], table["rms"][kept], style[0], ms=7, mfc="none", **look)
    axes[0].axhline(1.0, color="0.7", lw=1, zorder=0)
    axes[0].set(xscale="log", xlabel="tolerance", ylabel="kinetic energy / nearly exact")
    axes[0].invert_xaxis()
    axes[1].set(xscale="log", yscale="log", xlabel="CPU time of the solves [s]",
                ylabel="particles off by, rms [cells]")
    legend_below(figure, axes)
    return figure
