"""CG on the Hessian of a twisted bar whose middle gets stiffer, by preconditioner: iterations to a
reduction of 1e-6, and CPU time with set-up over that of our V-cycle with an exact coarsest level.
Hollow marks are solves that did not converge. Right: the stiff middle on finer grids, where run.
"""

import matplotlib.pyplot as plt
from matplotlib.ticker import LogLocator, NullFormatter

from ..common.style import legend_below, series

NEEDS = ["hot.preconditioners"]
STIFF = 1e9
LABELS = {"E": "E of the middle [Pa]", "iterations": "iterations",
          "ratio": "CPU time over ours", "particles": "particles; middle 1e9 Pa"}
CASES = {
    "jacobi-block": ("block Jacobi", "0.6", "x-"),
    "gauss-seidel": ("symmetric Gauss-Seidel", "0.3", "+-"),
    "cycle-3-direct": ("V-cycle, 3 levels", "C0", "o-"),
    "cycle-4-direct": ("V-cycle, 4 levels", "C9", "o--"),
    "cycle-3-direct-quadratic": ("V-cycle, quadratic", "C2", "o:"),
    "cycle-3-pcg": ("V-cycle, coarsest CG to 0.5", "C4", "s-"),
    "cycle-3-pcg-flexible": ("same, flexible CG", "C4", "s:"),
    "aggregation-rigid": ("smoothed aggregation, rigid modes", "C1", "^-"),
    "aggregation-constants": ("smoothed aggregation, constants", "C1", "^:"),
    "ruge-stuben": ("Ruge-Stüben", "C3", "v-"),
}


def scale(results):
    table = results.table(NEEDS[0], "costs")
    sizes = sorted({int(n) for n in table["particles"]})
    left = f"; left and middle {sizes[0]}" if len(sizes) > 1 else ""
    return f"{', '.join(map(str, sizes))} particles{left}"


def draw(results):
    table = results.table(NEEDS[0], "costs")
    coarse = table["particles"] == table["particles"].min()
    panels = [("E", "iterations", coarse), ("E", "ratio", coarse)]
    if not coarse.all():
        panels.append(("particles", "ratio", table["E"] == STIFF))
    figure, axes = plt.subplots(1, len(panels), figsize=(7.0, 3.2))
    for (case,), rows in series(table, ("case",)).items():
        for ax, (x, y, mask) in zip(axes, panels, strict=True):
            if case in CASES:
                line(ax, table, (x, y), rows & mask)
    for ax, (x, y, _) in zip(axes, panels, strict=True):
        ax.set(xscale="log", yscale="log", xlabel=LABELS[x], ylabel=LABELS[y])
        ax.xaxis.set(major_locator=LogLocator(numticks=4), minor_formatter=NullFormatter())
    if len(panels) > 2:
        places = sorted(set(table["particles"]))
        axes[2].set_xticks(places, [f"{n / 1000:.0f} 000" for n in places], fontsize=8, rotation=30)
    legend_below(figure, axes, columns=3)
    return figure


def line(ax, table, names, rows):
    """Draw a case over a column, hollow where it did not converge."""
    label, color, style = CASES[table["case"][rows][0]]
    x, y = (table[name][rows] for name in names)
    ax.plot(x, y, style, color=color, label=label, ms=5)
    hollow = table["converged"][rows] != "True"
    ax.plot(x[hollow], y[hollow], style[0], color=color, mfc="w", ms=5)
