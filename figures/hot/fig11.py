"""HOT, Figure 11: CPU time of each step of Faceless by HOT and by projected Newton with and without
a matrix, all from the states that HOT went through.
"""

import matplotlib.pyplot as plt

from ..common.style import legend_below, scales, series
from .fig20 import METHODS

NEEDS = ["hot.fig11"]


def scale(results):
    return scales(results, NEEDS[0])


def draw(results):
    table = results.table(NEEDS[0], "steps")
    figure, ax = plt.subplots(figsize=(6.4, 3.2))
    for k, ((method,), rows) in enumerate(series(table, ("method",)).items()):
        label, style = METHODS[method]
        ax.plot(table["t"][rows], table["cpu"][rows], style, ms=3, color=f"C{k}", label=label)
    ax.set(xlabel="time [s]", ylabel="CPU seconds of the step")
    ax.set_ylim(bottom=0.0)
    legend_below(figure, [ax], columns=3)
    return figure
