"""From which size on a reduced model of the arm pays, by a cost model. Top: CPU time of a step at
sizes to which the model is fitted (open) and at the one that checks it (filled). Bottom: what is
gained over the full-order run within the error (dashed) and over the cheapest run on any grid
(solid), by the smallest error that `trade.reduced` has of each method.
"""

import matplotlib.pyplot as plt

from ..common.style import legend_below, readable, scales, series

NEEDS = ["trade.reduced-size"]
GAIN = 5.0
STYLES = {              # method: (label, colour, marker)
    "full.apic": ("full", "k", "*"), "full.mls": ("full, MLS-MPM", "0.4", "P"),
    "pod.all": ("LDM, modes, all samples", "#31a354", "o"),
    "pod.few": ("LDM, modes, 50 samples", "#74c476", "v"),
    "nsf.all": ("NSF, modes, all samples", "#756bb1", "h"),
    "nsf.few": ("NSF, modes, few samples", "#9e9ac8", "^"),
    "corrected.2": ("2 times as coarse, corrected", "#e6550d", "s"),
    "corrected.4": ("4 times as coarse, corrected", "#fdae6b", "D")}


def scale(results):
    return scales(results, NEEDS[0], ".step")


def draw(results):
    figure, axes = plt.subplots(2, 1, figsize=(7.0, 6.4))
    steps(axes[0], results.table(NEEDS[0], "steps"))
    gains(axes[1], results.table(NEEDS[0], "gains"))
    legend_below(figure, axes)
    return figure


def steps(ax, table):
    """Draw the time of a step by the cost model and as measured."""
    for (method,), rows in series(table, ("method",)).items():
        label, color, mark = STYLES[method]
        n, fitted = table["particles"][rows], table["fitted"][rows] > 0
        cpu = 1e3 * table["cpu"][rows]
        ax.loglog(n, 1e3 * table["predicted"][rows], "-", color=color, lw=1)
        ax.loglog(n[fitted], cpu[fitted], mark, color=color, mfc="w", ms=6)
        ax.loglog(n[~fitted], cpu[~fitted], mark, color=color, ms=6, label=label)
    ax.set(xlabel="particles", ylabel="CPU time of a step [ms]")
    readable(ax.xaxis, (1.0, 3.0))


def gains(ax, table):
    """Draw the gains by the cost model."""
    for (method,), rows in series(table, ("method",)).items():
        label, color, _ = STYLES[method]
        n = table["particles"][rows]
        ax.loglog(n, table["gain"][rows], "-", color=color, label=label)
        ax.loglog(n, table["gain_full"][rows], "--", color=color, lw=1)
    for gain in (1.0, GAIN):
        ax.axhline(gain, color="0.4", ls=":", lw=1)
    ax.set(xlabel="particles", ylabel="times as cheap")
