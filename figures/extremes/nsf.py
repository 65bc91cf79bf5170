"""NSF: reduced runs with parameters within the trained range and outside. Left: error of the
displacement, over the largest of the scene's tests, against how far latent coordinates leave the
trained ones; above the horizontal line a run is bad, right of the vertical one it is flagged, so
that false alarms are below on the right, and misses above on the left. Right: the shares of good
runs that are flagged and of bad ones that are not, by where the vertical line is drawn.
"""

import matplotlib.pyplot as plt
import numpy as np

from mpm_ref.rom.extrapolation import BEYOND
from validation.extremes.ldm_runs import BAD

from ..common.style import readable, scales, series
from ..trade.nsf import COLOURS

NEEDS = ["extremes.nsf.beyond"]


def scale(results):
    return scales(results, NEEDS[0], "false_alarms")


def draw(results):
    figure, axes = plt.subplots(1, 2, figsize=(7.0, 3.8))
    runs(axes[0], results.table(NEEDS[0], "runs"))
    rates(axes[1], results.table(NEEDS[0], "rates"))
    for ax in axes:
        ax.axvline(BEYOND, color="0.5", lw=1)
        ax.set_xscale("log")
        readable(ax.xaxis, (1.0, 2.0, 5.0))
        ax.legend(fontsize=8)
    figure.tight_layout()
    return figure


def runs(ax, table):
    """Draw a mark for each run that reached its end, with the parameter of flagged and bad ones."""
    for (scene,), rows in series(table, ("model",)).items():
        rows = rows & np.isfinite(table["error"])
        x, y = table["beyond"][rows], table["error"][rows] / table["usual"][rows]
        ax.plot(x, y, "o", color=COLOURS[scene], ms=5, fillstyle="none", label=scene)
        told = (x > BEYOND) | (y > BAD)
        for a, b, value in zip(x[told], y[told], table["what"][rows][told], strict=True):
            ax.annotate(f"{value:g}", (a, b), fontsize=7, xytext=(4, 3),
                        textcoords="offset points")
    ax.axhline(BAD, color="0.5", lw=1)
    ax.set(yscale="log", xlabel="distance of the latent coordinates, over the trained gap",
           ylabel="displacement error over that of tests")
    readable(ax.yaxis, (1.0, 2.0, 5.0))


def rates(ax, table):
    """Draw the shares of false alarms and misses over the bound."""
    for name, label, style in (("false_alarms", "good, and flagged", "o-"),
                               ("misses", "bad, and neither flagged nor stopped", "s--")):
        ax.plot(table["bound"], table[name], style, color="k", ms=4, fillstyle="none", label=label)
    ax.set(xlabel="bound", ylabel="share", ylim=(-0.05, 1.05))
