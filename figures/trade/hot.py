"""One step of a twisted bar with a stiff middle, solved to a ladder of tolerances: what each method
costs for the error it leaves in the particles. Large marks: the paper's tolerance, 1e-7.
"""

import matplotlib.pyplot as plt

from ..common.style import legend_below, scales, series
from ..hot.fig20 import METHODS

NEEDS = ["trade.hot.bar"]
PAPER = 1e-7


def scale(results):
    return scales(results, NEEDS[0])


def draw(results):
    table = results.table(NEEDS[0], "points")
    stiff = series(table, ("E",))
    figure, axes = plt.subplots(1, len(stiff), figsize=(7.0, 3.2), sharey=True,
                                squeeze=False)
    for ax, ((E,), rows) in zip(axes[0], stiff.items(), strict=True):
        for k, (method, (label, style)) in enumerate(METHODS.items()):
            curve = rows & (table["method"] == method)
            ax.loglog(table["cpu"][curve], table["error"][curve], style, ms=4, color=f"C{k}",
                      label=label)
            printed = curve & (table["eps"] == PAPER)
            ax.loglog(table["cpu"][printed], table["error"][printed], style[0], ms=9, color=f"C{k}")
        ax.set(title=f"middle {E:.0e} Pa", xlabel="CPU time of the step [s]")
    axes[0][0].set_ylabel("error / velocity increment, rms over particles")
    legend_below(figure, axes[0], columns=5)
    return figure
