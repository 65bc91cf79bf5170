"""One step of HOT's scenes, solved to a ladder of tolerances: what each method costs for the error
it leaves in the particles, or the reference's own error where that is larger; solves that found
nothing to do are left out. Large marks: the paper's tolerance, 1e-7; Gast15 has tolerances of its
own. Finer: more particles.
"""

from math import ceil

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.ticker import NullFormatter

from ..common.style import legend_below, scales, series
from .hot import PAPER
from .hot_energy import METHODS as SOME

NEEDS = ["trade.hot.scenes"]
METHODS = {**SOME, "hot-quadratic": ("HOT-quadratic", "o:"), "lbfgs-gmg": ("LBFGS-GMG", "s:"),
           "sgs-pcg": ("SGS-PCG", "^:"), "pn-gmg-pcg": ("PN-GMG-PCG", "d:"),
           "admm": ("ADMM", "x:"), "gast15": ("Gast15", "v:")}
COLOURS = ("C0", "C1", "C2", "C3", "C4", "C5", "C0", "C1", "C6", "C4", "C8", "C7")
COLUMNS = 4


def scale(results):
    return scales(results, NEEDS[0], ".reference")


def draw(results):
    table = results.table(NEEDS[0], "points")
    trials = series(table, ("scene", "size"))
    columns = min(COLUMNS, len(trials))
    lines = ceil(len(trials) / columns)
    figure, axes = plt.subplots(lines, columns, figsize=(1.6 + 2.4 * columns, 0.8 + 2.4 * lines),
                                squeeze=False)
    for ax in axes.flat[len(trials):]:
        ax.axis("off")
    for ax, ((scene, size), rows) in zip(axes.flat, trials.items(), strict=False):
        panel(ax, table, rows)
        ax.set_title(scene.replace("_", ", ") + (", finer" if size == "standard" else ""),
                     fontsize=9)
    for ax in axes[:, 0]:
        ax.set_ylabel("error / increment, rms", fontsize=8)
    figure.supxlabel("CPU time of the step [s]", fontsize=9)
    legend_below(figure, axes.flat, columns=6)
    return figure


def panel(ax, table, rows):
    """Draw the curves of all methods in the rows of one trial."""
    error = np.maximum(table["error"], table["least"])
    for (method, (label, style)), colour in zip(METHODS.items(), COLOURS, strict=True):
        curve = rows & (table["method"] == method) & (table["iterations"] > 0)
        if curve.any():
            ax.loglog(table["cpu"][curve], error[curve], style, ms=3, color=colour, label=label)
        paper = curve & (table["eps"] == PAPER)
        ax.loglog(table["cpu"][paper], error[paper], style[0], ms=8, color=colour)
    ax.xaxis.set_minor_formatter(NullFormatter())
