"""NCLaw: learned laws in runs that they were not trained on. Above, left: error over that of the
trained run, against how far strains leave those of training; above the horizontal line a run is
bad, right of the vertical one it is flagged, so that false alarms are below on the right, and
misses above on the left. Right: the shares of good runs that are flagged and of bad ones that are
not, by where the vertical line is drawn; dashed of laws that it was not chosen with. Below: by
density, and by the length of the step, over those of training; full marks are flagged, runs that
broke down are left out.
"""

import matplotlib.pyplot as plt
import numpy as np

from mpm_ref.nclaw.strain_watch import MAX_EXCESS
from validation.extremes.nclaw_runs import BAD

from ..common.style import readable, scales, series
from ..nclaw.loss import COLOURS

NEEDS = ["extremes.nclaw.strain", "extremes.nclaw.density", "extremes.nclaw.dt"]
TRAINED = "as trained"
GROUPS = {"chosen": "-", "other": "--"}
SMALL = 0.1         # up to which distances are drawn evenly


def scale(results):
    return scales(results, NEEDS[0], "silent")


def draw(results):
    figure, axes = plt.subplots(2, 2, figsize=(7.0, 7.4))
    strains(axes[0, 0], results.table(NEEDS[0], "runs"))
    rates(axes[0, 1], results.table(NEEDS[0], "rates"))
    for ax, id, what in zip(axes[1], NEEDS[1:], ("density", "length of the step"), strict=True):
        by_factor(ax, results.table(id, "runs"))
        ax.set_xlabel(f"{what}, over that of training")
    for ax in axes.flat:
        ax.legend(fontsize=8)
    figure.tight_layout()
    return figure


def over_baseline(table):
    """Return errors over the baseline of the law."""
    return table["error"] / table["usual"]


def strains(ax, table):
    """Draw a mark for each run that reached its end."""
    for (name,), rows in series(table, ("law",)).items():
        rows = rows & np.isfinite(table["error"])
        ax.plot(table["beyond"][rows], over_baseline(table)[rows], "o", color=COLOURS[name], ms=4,
                fillstyle="none", label=name)
    ax.axhline(BAD, color="0.5", lw=1)
    ax.axvline(MAX_EXCESS, color="0.5", lw=1)
    ax.set_xscale("symlog", linthresh=SMALL)
    ax.set_xlim(-0.2 * SMALL, 1.5 * ax.dataLim.x1)
    ax.set(yscale="log", xlabel="distance of strains from those of training, in their width",
           ylabel="error over that of the trained run")
    readable(ax.yaxis, (1.0,))


def rates(ax, table):
    """Draw the shares of false alarms and misses over the bound."""
    for group, dash in GROUPS.items():
        rows = (table["laws"] == group) & (table["error"] == BAD)
        for wrong, total, text, mark in (("false_alarms", "good", "good, and flagged", "o"),
                                         ("misses", "bad", "bad, and not flagged", "s")):
            share = table[wrong][rows] / np.maximum(table[total][rows], 1)
            label = text if group == "chosen" else f"{text}: other laws"
            ax.plot(table["beyond"][rows], share, f"{mark}{dash}", color="k", ms=4,
                    fillstyle="none", label=label)
    ax.axvline(MAX_EXCESS, color="0.5", lw=1)
    ax.set(xlabel="bound", ylabel="share", ylim=(-0.05, 1.05))


def by_factor(ax, table):
    """Draw a curve for each law; full marks where the run was flagged."""
    factor = np.array([1.0 if what == TRAINED else float(what.split()[0])
                       for what in table["what"]])
    for (name,), rows in series(table, ("law",)).items():
        rows = np.flatnonzero(rows & np.isfinite(table["error"]))
        rows = rows[np.argsort(factor[rows])]
        x, y = factor[rows], over_baseline(table)[rows]
        ax.loglog(x, y, "o-", color=COLOURS[name], ms=5, fillstyle="none", label=name)
        flagged = table["flags"][rows] != ""
        ax.plot(x[flagged], y[flagged], "o", color=COLOURS[name], ms=5)
    ax.axhline(BAD, color="0.5", lw=1)
    ax.set_ylabel("error over that of the trained run")
    readable(ax.xaxis, (1.0, 2.0, 5.0))
    readable(ax.yaxis, (1.0,))
