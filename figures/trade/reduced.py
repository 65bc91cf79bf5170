"""A soft arm with six parameters, by size. Top: error of the displacement against CPU time of a
run, for full-order runs (black), what is looked up in training runs (grey), reduced models and
coarse runs with a learned correction. Bottom: the method that is cheapest, training included, for a
number of runs and an error that is allowed.
"""

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.colors import ListedColormap
from matplotlib.patches import Patch

from ..common.style import scales, series

NEEDS = ["trade.reduced"]
RUNS, ERRORS = np.geomspace(1.0, 1e4, 81), np.geomspace(3e-3, 1.0, 76)
STYLES = {              # method: (label, colour, marker)
    "full.apic": ("full", "k", "*"), "full.mls": ("full, MLS-MPM", "0.25", "P"),
    "coarse.1.25.apic": ("grid 1.25 times as coarse", "#dadaeb", "p"),
    "coarse.1.25.mls": ("1.25 times as coarse, MLS-MPM", "#54278f", "p"),
    "coarse.1.5.apic": ("grid 1.5 times as coarse", "#9e9ac8", "X"),
    "coarse.1.5.mls": ("1.5 times as coarse, MLS-MPM", "#6a51a3", "X"),
    "coarse.1.75.apic": ("grid 1.75 times as coarse", "#9ecae1", ">"),
    "coarse.1.75.mls": ("1.75 times as coarse, MLS-MPM", "#2171b5", ">"),
    "coarse.2.apic": ("grid 2 times as coarse", "#3182bd", "s"),
    "coarse.2.mls": ("2 times as coarse, MLS-MPM", "#08519c", "s"),
    "coarse.4.apic": ("grid 4 times as coarse", "#9ecae1", "D"),
    "coarse.4.mls": ("4 times as coarse, MLS-MPM", "#6baed6", "D"),
    "nearest": ("nearest training run", "0.7", "v"),
    "linear": ("linear in parameters", "0.85", "^"),
    "corrected.2": ("2 times as coarse, corrected", "#e6550d", "s"),
    "corrected.4": ("4 times as coarse, corrected", "#fdae6b", "D"),
    "pod.all": ("LDM, modes, all samples", "#31a354", "o"),
    "pod.few": ("LDM, modes, 50 samples", "#a1d99b", "o"),
    "curved": ("LDM, curved", "#006d2c", "<"),
    "nsf.all": ("NSF, modes, all samples", "#756bb1", "h"),
    "nsf.few": ("NSF, modes, few samples", "#bcbddc", "h")}


def scale(results):
    return scales(results, NEEDS[0])


def draw(results):
    table = results.table(NEEDS[0], "methods")
    sizes = series(table, ("particles",))
    figure, axes = plt.subplots(2, len(sizes), figsize=(7.0, 5.6), sharey="row", squeeze=False)
    shown = set()
    for column, ((n,), rows) in zip(axes.T, sizes.items(), strict=True):
        column[0].set_title(f"{int(n):,} particles".replace(",", " "))
        points(column[0], table, rows)
        shown |= region(column[1], table, rows)
        column[0].set_xlabel("CPU time of a run [s]")
        column[1].set_xlabel("runs")
    axes[0, 0].set_ylabel("error / displacement")
    axes[1, 0].set_ylabel("error that is allowed")
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.tight_layout()
    marks = figure.legend(handles, labels, loc="upper center", ncol=3, bbox_to_anchor=(0.5, 0.0))
    figure.add_artist(marks)
    cheapest = [method for method in STYLES if method in shown]
    figure.legend([Patch(color=STYLES[method][1]) for method in cheapest],
                  [STYLES[method][0] for method in cheapest], loc="lower center", ncol=3,
                  bbox_to_anchor=(0.5, 1.0), title="bottom: cheapest")
    return figure


def points(ax, table, rows):
    """Draw the error of each method against the CPU time of a run; that of the full-order run, 0,
    at the foot.
    """
    for method, error, cpu in zip(*(table[name][rows] for name in ("method", "error", "cpu_run")),
                               strict=True):
        if np.isfinite(error):
            label, color, mark = STYLES[method]
            ax.loglog(cpu, max(error, ERRORS[0]), mark, color=color, ms=6, mec="k", mew=0.4,
                      label=label)
    ax.set_ylim(0.8 * ERRORS[0], 2.0)


def region(ax, table, rows):
    """Draw which method is cheapest for a number of runs and an error; return those that are."""
    names = list(STYLES)
    methods, error = table["method"][rows], table["error"][rows]
    first = sum(table[name][rows] for name in ("cpu_fit", "cpu_data", "cpu_pairs"))
    cost = first + RUNS[:, None] * table["cpu_run"][rows]
    number = np.array([names.index(one) if one in names else -1 for one in methods])
    allowed = (error <= ERRORS[:, None]) & (number >= 0)
    total = np.where(allowed[:, None], cost, np.inf)
    best = number[np.argmin(total, axis=2)]
    ax.pcolormesh(RUNS, ERRORS, best, cmap=ListedColormap([STYLES[method][1] for method in names]),
                  vmin=-0.5, vmax=len(names) - 0.5, rasterized=True)
    ax.set(xscale="log", yscale="log")
    ax.grid(visible=False)
    return {names[k] for k in np.unique(best)}
