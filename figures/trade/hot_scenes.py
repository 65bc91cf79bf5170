"""One step of HOT's scenes, solved to a ladder of tolerances: what each method costs for the error
it leaves in the particles, or the reference's own error where that is larger; solves that found
nothing to do are left out. The front of each panel, which no method passes, is drawn, and marked by
the method that reaches it; all other solves are grey, those of HOT are blue. Large ring: HOT at the
paper's tolerance, 1e-7. Finer: more particles.
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
COLOURS = ("C0", "C1", "C2", "C3", "C4", "C5", "C9", "C8", "C6", "0.2", "y", "C7")
COLUMNS, WIDTH, HEIGHT = 3, 7.0, 1.9    # of panels; of the figure, of a panel [inch]
LEAST = 0.9         # share of the error that a slower solve must undercut to be on the front


def scale(results):
    clauses = scales(results, NEEDS[0], ".reference").split("; ")
    return f"{len(clauses)} steps, the first of {clauses[0]}, the last of {clauses[-1]}"


def draw(results):
    table = results.table(NEEDS[0], "points")
    table["shown"] = np.maximum(table["error"], table["least"])
    trials = series(table, ("scene", "size"))
    columns = min(COLUMNS, len(trials))
    lines = ceil(len(trials) / columns)
    figure, axes = plt.subplots(lines, columns, figsize=(WIDTH, HEIGHT * lines), squeeze=False)
    for ax in axes.flat[len(trials):]:
        ax.axis("off")
    for ax, ((scene, size), rows) in zip(axes.flat, trials.items(), strict=False):
        panel(ax, table, rows)
        ax.set_title(scene.replace("_", ", ") + (", finer" if size == "standard" else ""))
    figure.supxlabel("CPU time of the step [s]", fontsize=9)
    figure.supylabel("error over the increment of velocity, rms over particles", fontsize=9)
    legend_below(figure, axes.flat, columns=5)
    return figure


def panel(ax, table, rows):
    """Draw all solves of one trial, and its front."""
    rows = rows & (table["iterations"] > 0)
    cpu, error, of_hot = table["cpu"], table["shown"], table["method"] == "hot"
    ax.loglog(cpu[rows & ~of_hot], error[rows & ~of_hot], ".", ms=3, color="0.78",
              label="all solves")
    ax.loglog(cpu[rows & of_hot], error[rows & of_hot], "-", lw=0.8, color="C0", zorder=1,
              label="HOT, all tolerances")
    best = front(cpu, error, np.flatnonzero(rows))
    ax.loglog(cpu[best], error[best], "-", color="0.3", lw=0.8, zorder=2, label="front")
    for (method, (label, style)), colour in zip(METHODS.items(), COLOURS, strict=True):
        own = best[table["method"][best] == method]
        if len(own):
            ax.loglog(cpu[own], error[own], style[0], ms=5, color=colour, label=label)
    paper = rows & of_hot & (table["eps"] == PAPER)
    ax.loglog(cpu[paper], error[paper], "o", ms=10, mfc="none", color="C0",
              label="HOT, paper's tolerance")
    ax.xaxis.set_minor_formatter(NullFormatter())
    ax.yaxis.set_minor_formatter(NullFormatter())


def front(cost, error, rows):
    """Return those of the rows, by cost, whose error is the least of all that cost no more."""
    best, lowest = [], np.inf
    for k in sorted(rows, key=lambda k: (cost[k], error[k])):
        if error[k] < LEAST * lowest:
            best.append(k)
            lowest = error[k]
    return np.array(best, dtype=int)
