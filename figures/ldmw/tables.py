"""LDM workshop, Tables 1 and 2: errors of position, velocity and deformation gradient in reduced
runs of one step (dots), and those that are printed (bars), or printed as the most (with an arrow).
"""

import matplotlib.pyplot as plt
import numpy as np

from validation.common import targets

from ..common.style import legend_below, shared_scale

NEEDS = ["ldmw.table1", "ldmw.table2"]
FIELDS = {"position": ("position", "C0"), "velocity": ("velocity", "C1"),
          "defgrad": ("deformation gradient", "C2")}
ROWS = {"ldmw.table1": {"none": "no penalty", "temporal": "of v", "both": "of F and v"},
        "ldmw.table2": {"point": "points", "node": "nodes", "point_hyper6": "six\npoints",
                        "node_hyper6": "nodes of\nsix points"}}
TITLES = ("Table 1: penalties in the loss", "Table 2: what is sampled")
WIDTH = 0.22        # of a field in a row


def scale(results):
    return "; ".join(f"{title.split(':')[0]}: {shared_scale(results, name)}"
                     for name, title in zip(NEEDS, TITLES, strict=True))


def draw(results):
    figure, axes = plt.subplots(1, 2, figsize=(7.0, 3.8), sharey=True, width_ratios=(3, 4))
    for ax, name, title in zip(axes, NEEDS, TITLES, strict=True):
        panel(ax, {r.target: r for r in results.records(name)}, name)
        ax.set_title(title)
    axes[0].set_ylabel("error [%]")
    legend_below(figure, axes, columns=3)
    return figure


def panel(ax, records, table):
    """Plot all rows of a table, its fields side by side."""
    for j, (field, (words, colour)) in enumerate(FIELDS.items()):
        at = np.arange(len(ROWS[table])) + (j - 1) * WIDTH
        column = [records[f"{table}.{row}.{field}"] for row in ROWS[table]]
        for x, record in zip(at, column, strict=True):
            printed_bar(ax, x, record)
        ax.semilogy(at, [r.value for r in column], "o", color=colour, ms=5, label=words)
    ax.set_xticks(range(len(ROWS[table])), ROWS[table].values(), fontsize=8)
    ax.grid(visible=False, axis="x")


def printed_bar(ax, x, record):
    """Plot a bar at the printed value, with an arrow where it is an upper bound."""
    printed = targets.load()[record.target]
    ax.plot([x - 0.4 * WIDTH, x + 0.4 * WIDTH], 2 * [printed.value], color="0.3", lw=2.0)
    if printed.comparator == "<=":
        ax.annotate("", (x, 0.6 * printed.value), (x, printed.value),
                    arrowprops={"arrowstyle": "->", "color": "0.3", "lw": 0.8})
