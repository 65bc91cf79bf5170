"""NCLaw: what a run of learned laws costs. Left: error and CPU time by the length of the step, in
that of training, the label of the marks; true laws with the same step miss the trained one
too. The dotted lines are Pareto fronts. Right: error by how many binary digits of the weights
are left; 53 is a double, 24 single precision. Crosses at the upper edge: runs that broke down.
"""

import matplotlib.pyplot as plt
import numpy as np

from ..common.style import readable, scales, series
from ..common.training_errors import mark_broken
from ..nclaw.loss import COLOURS
from .nclaw import annotate_points

NEEDS = ["trade.nclaw.dt", "trade.nclaw.digits"]
TITLES = ("length of the step", "digits of the weights")


def scale(results):
    return scales(results, NEEDS[1])


def draw(results):
    figure, axes = plt.subplots(1, 2, figsize=(7.0, 3.8), width_ratios=(3, 2))
    steps(axes[0], results.table(NEEDS[0], "steps"))
    digits(axes[1], results.table(NEEDS[1], "digits"))
    for ax, title in zip(axes, TITLES, strict=True):
        ax.set_title(title)
        ax.set_ylabel("error [m²]")
        readable(ax.xaxis, (1.0, 2.0, 5.0))
        ax.legend(fontsize=8)
    figure.tight_layout()
    return figure


def steps(ax, table):
    """Draw for each material a curve of its learned laws, and one of its true laws."""
    for (name,), rows in series(table, ("environment",)).items():
        ours, true = ((table[cpu][rows], table[error][rows]) for cpu, error in
                      (("cpu", "error"), ("true_cpu", "true_error")))
        best = rows & (table["pareto"] == 1)
        ax.loglog(*ours, "o", color=COLOURS[name], ms=5, fillstyle="none", label=f"{name}, learned")
        ax.plot(table["cpu"][best], table["error"][best], ":", color=COLOURS[name], zorder=0)
        annotate_points(ax, ours, table["factor"][rows])
        mark_broken(ax, ours[0][~np.isfinite(ours[1])], COLOURS[name])
        off = true[1] > 0.0         # with the trained step they have no error
        ax.plot(true[0][off], true[1][off], "+", color=COLOURS[name], ms=6,
                label=f"{name}, true laws")
        annotate_points(ax, (true[0][off], true[1][off]), table["factor"][rows][off])
    ax.set_xlabel("CPU time of the run [s]")


def digits(ax, table):
    """Draw a curve for each material."""
    for (name,), rows in series(table, ("environment",)).items():
        ax.loglog(table["bits"][rows], table["error"][rows], "o-", color=COLOURS[name], ms=5,
                  fillstyle="none", label=name)
    ax.set_xlabel("binary digits")
