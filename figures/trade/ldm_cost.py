"""LDM on the tower. Left: where the time of a reduced step goes, by the paper's scheme and with all
cheap choices, by number of particles. Right: after how many runs the time of data and training is
paid, beside the full model with the transfer that the map was trained on, and with the fastest; a
curve has no mark where it never is.
"""

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.ticker import NullLocator

from ..common.style import legend_below, readable, series, titled_scales

NEEDS = ["trade.ldm.split", "trade.ldm.offline"]
TITLES = ("where the time goes", "when training pays")
PARTS = {"network": ("network", "0.35", ""),
         "quadrature": ("search for preimages", "#9ecae1", "//"), "grid": ("grid", "#fdd0a2", ".."),
         "projection": ("projection", "k", ""), "rest": ("rest", "w", "")}
AGAINST = {"runs_same": ("the transfer it was trained on", "s-"),
           "runs": ("the fastest transfer", "o--")}


def scale(results):
    return titled_scales(results, NEEDS, TITLES)


def draw(results):
    figure, axes = plt.subplots(1, 2, figsize=(7.0, 3.8), width_ratios=(5, 4))
    split(axes[0], results.table(NEEDS[0], "parts"))
    pays(axes[1], results.table(NEEDS[1], "pays"))
    for ax, title in zip(axes, TITLES, strict=True):
        ax.set_title(title)
    legend_below(figure, axes[:1], columns=5)
    return figure


def split(ax, table):
    """Draw a bar for each size and scheme, the network's part at the bottom."""
    sizes, x = series(table, ("particles",)), np.arange(len(table["cpu"]))
    low = np.zeros(len(x))
    for name, (words, colour, hatch) in PARTS.items():
        ax.bar(x, 1e3 * table[name], 0.7, low, color=colour, hatch=hatch, edgecolor="k", lw=0.6,
               label=words)
        low += 1e3 * table[name]
    ax.set_xticks(x, table["way"], fontsize=8)
    ax.set_xticks([x[rows].mean() for rows in sizes.values()],
                  [f"\n{thousand(n)}" for n, in sizes], minor=True, fontsize=9)
    ax.tick_params(axis="x", which="minor", length=0, pad=7)
    ax.set(xlabel="particles", ylabel="CPU time of a step [ms]", axisbelow=True)
    ax.grid(visible=False, axis="x")


def pays(ax, table):
    """Draw the runs after which training has paid, by size, and mark sizes where it never has."""
    n, runs = table["particles"], np.array([table[name] for name in AGAINST])
    for needed, (label, style) in zip(runs, AGAINST.values(), strict=True):
        paid = np.isfinite(needed)
        ax.plot(n[paid], needed[paid], style, color="C3", fillstyle="none", label=label)
    for count in n[~np.isfinite(runs).any(axis=0)]:
        ax.text(count, 0.3, "never", transform=ax.get_xaxis_transform(), rotation=90, ha="center",
                va="center", fontsize=9, backgroundcolor="w")
    finite = runs[np.isfinite(runs)]
    ax.set(xscale="log", yscale="log", xlim=(n.min() / 2.0, 2.0 * n.max()),
           ylim=(0.5 * np.min(finite, initial=2.0), 2.0 * np.max(finite, initial=50.0)),
           xlabel="particles", ylabel="runs until training has paid")
    ax.legend(title="against the full model with", title_fontsize=8, fontsize=8, loc="lower left",
              alignment="left")
    readable(ax.yaxis, (1.0, 2.0, 5.0))
    ax.set_xticks(n, [thousand(count) for count in n], fontsize=9)
    ax.xaxis.set_minor_locator(NullLocator())


def thousand(count):
    """Return a number of particles as text."""
    return f"{count / 1e6:.3g} million" if count >= 1e6 else f"{count / 1e3:.0f} thousand"
