"""Errors at a wall. Left: column of water, mean error of the pressure and largest error of a
particle's height, with a sticky floor and without a wall. Right: force on the platen of an
oedometer that compresses by a quarter.
"""

import matplotlib.pyplot as plt
import numpy as np

from ..common.style import OTHERS, TRANSFERS, counts, legend_below, scales, slope

NEEDS = ["verification.hydrostatic", "verification.oedometer"]
TICKS = (0.02, 0.05, 0.1, 0.2, 0.4)


def scale(results):
    cells = counts(results.table(NEEDS[1], "platen")["cells"])
    return (f"strips one cell wide; left: {scales(results, NEEDS[0])}; right: {cells} cells over "
            "the height, mls-quadratic-2")


def draw(results):
    figure, (left, right) = plt.subplots(1, 2, figsize=(7.0, 3.8))
    table = results.table(NEEDS[0], "errors")
    for wall, mark in (("False", "o"), ("True", "s")):
        rows, support = table["wall"] == wall, "wall" if wall == "True" else "symmetric"
        for column, color in zip(("pressure_error", "place_error"), OTHERS):
            left.loglog(table["cells"][rows], table[column][rows], mark + "-", color=color, ms=4,
                        label=f"{column.split('_')[0]}, {support}")
    cells = sorted(set(table["cells"]))
    slope(left, -2, (cells[0], cells[-1]), 8e-4, "order 2")
    slope(left, -1, (cells[0], cells[-1]), 2e-2, "order 1")
    left.set(xlabel="cells over the height", ylabel="relative error")
    platen = results.table(NEEDS[1], "platen")
    right.loglog(platen["cells"], np.abs(platen["force_error"]), "s-", ms=4, color=TRANSFERS["mls"])
    slope(right, -1, (platen["cells"][0], platen["cells"][-1]),
          0.7 * abs(platen["force_error"][0]), "order 1")
    right.set(xlabel="cells over the height", ylabel="|force / closed form - 1|",
              yticks=TICKS, yticklabels=[f"{100 * tick:g} %" for tick in TICKS],
              ylim=(0.4 * np.abs(platen["force_error"]).min(), 0.4))
    for ax, ticks in ((left, cells), (right, platen["cells"])):
        ax.set(xticks=ticks, xticklabels=[f"{n:.0f}" for n in ticks])
        ax.minorticks_off()
    legend_below(figure, [left])
    return figure
