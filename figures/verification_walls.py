"""What a wall costs. Left: column of water, mean error of the pressure and largest error of a
particle's height, with a sticky floor and without a wall. Right: force on the platen of an
oedometer that compresses by a quarter.
"""

import matplotlib.pyplot as plt
import numpy as np

from ._orders import slope

NEEDS = ["verification.hydrostatic", "verification.oedometer"]


def draw(results):
    figure, (left, right) = plt.subplots(1, 2, figsize=(8.4, 3.8))
    table = results.table(NEEDS[0], "errors")
    for wall, mark in (("False", "o"), ("True", "s")):
        rows, held = table["wall"] == wall, "wall" if wall == "True" else "symmetric"
        for column, color in (("pressure_error", "C0"), ("place_error", "C2")):
            left.loglog(table["cells"][rows], table[column][rows], mark + "-", color=color, ms=4,
                        label=f"{column.split('_')[0]}, {held}")
    cells = sorted(set(table["cells"]))
    slope(left, -2, (cells[0], cells[-1]), 1e-3, "2")
    slope(left, -1, (cells[0], cells[-1]), 2e-2, "1")
    left.set(xlabel="cells over the height", ylabel="relative error")
    platen = results.table(NEEDS[1], "platen")
    right.loglog(platen["cells"], np.abs(platen["force_error"]), "s-", ms=4, label="platen")
    slope(right, -1, (platen["cells"][0], platen["cells"][-1]), 0.2, "1")
    right.set(xlabel="cells over the height", ylabel="|force / closed form - 1|",
              yticks=(0.05, 0.1, 0.2, 0.4), yticklabels=("5 %", "10 %", "20 %", "40 %"))
    for ax, ticks in ((left, cells), (right, platen["cells"])):
        ax.set(xticks=ticks, xticklabels=[f"{n:.0f}" for n in ticks])
        ax.minorticks_off()
        ax.legend(fontsize=7)
    figure.tight_layout()
    return figure
