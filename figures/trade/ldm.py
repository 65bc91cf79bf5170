"""LDM: error of reduced runs by their options. Left: error against wall time on the tower. The star
is the paper's scheme, single marks differ from it as the legend shows; curves go over numbers of
samples (their labels). The dotted line is the Pareto front of error and CPU time. Right: torsion
with all samples, by the density of quadrature points. Runs that broke down are left out.
"""

from itertools import cycle

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.ticker import MaxNLocator

from ..common.style import OTHERS, legend_below, readable, titled_scales

NEEDS = ["trade.ldm.knobs", "trade.ldm.density"]
TITLES = ("tower", "torsion")
WORDS = {"quadrature": "quadrature: {}", "per_cell": "quadrature points to a cell and axis: {:g}",
         "projection": "projection: {}", "velocity": "velocity: {}", "samples": "samples: {}",
         "preimage_tolerance": "preimages: {:g} dx", "precision": "precision: {}"}
MARKS = "oD^v<>PXHdp+x12s"
RANGE = 2.0         # up and down from the middle of errors, at least
DENSE = {"eulerian": ("Eulerian", "v-", "C4"), "resampled": ("resampled", "D--", "C5")}


def scale(results):
    return titled_scales(results, NEEDS, TITLES)


def draw(results):
    figure, axes = plt.subplots(1, 2, figsize=(7.0, 4.2), width_ratios=(3, 2))
    choices(axes[0], results.table(NEEDS[0], "ways"))
    densities(axes[1], results.table(NEEDS[1], "densities"))
    for ax, title in zip(axes, TITLES, strict=True):
        ax.set_title(title)
        ax.set_ylabel("position error [%]")
        low, high = ax.get_ylim()
        middle = np.sqrt(low * high)
        ax.set_ylim(min(low, middle / RANGE), max(high, RANGE * middle))
        readable(ax.yaxis)
    readable(axes[0].xaxis)
    axes[0].set_xlabel("wall time of a step [ms]")
    axes[1].set_xlabel("quadrature points of a cell along each axis")
    legend_below(figure, axes[:1], columns=3)
    return figure


def choices(ax, table):
    """Draw marks by what differs from the first row, joined where only the samples do."""
    x, y, points = 1e3 * table["wall"], 100.0 * table["origin"], table["points"]
    front = np.flatnonzero(table["pareto"])
    front = front[np.argsort(x[front])]
    ax.loglog(x[front], y[front], ":", color="0.3", zorder=0, label="Pareto front")
    for (words, rows), mark, colour in zip(grouped(table).items(), cycle(MARKS), cycle(OTHERS)):
        rows = sorted(rows, key=lambda k: points[k])
        ax.plot(x[rows], y[rows], mark + "-" * (len(rows) > 1), color=colour, ms=6,
                fillstyle="none", label=words or "the paper's scheme")
        for k in rows if len(rows) > 1 else ():
            ax.annotate(f"{points[k]:g}", (x[k], y[k]), fontsize=7, xytext=(3, 6),
                        textcoords="offset points")
    ax.plot(x[0], y[0], "k*", ms=10, label=f"{points[0]:g} samples, as single marks")


def grouped(table):
    """Return {difference from the first row other than the number of samples: rows}."""
    rows = {}
    for k in range(len(table["points"])):
        words = ", ".join(form.format(table[name][k]) for name, form in WORDS.items()
                          if table[name][k] != table[name][0])
        rows.setdefault(words, []).append(k)
    return rows


def densities(ax, table):
    """Draw curves by quadrature, and a line for material points."""
    error = 100.0 * table["origin"]
    for name, (words, style, colour) in DENSE.items():
        rows = table["quadrature"] == name
        if rows.any():
            ax.semilogy(table["per_cell"][rows], error[rows], style, color=colour, ms=6,
                        fillstyle="none", label=words)
    ax.axhline(error[table["quadrature"] == "lagrangian"][0], color="k", ls=":",
               label="Lagrangian: material points")
    ax.xaxis.set_major_locator(MaxNLocator(integer=True))
    ax.legend(fontsize=8)
