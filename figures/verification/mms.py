"""Axis-aligned manufactured solution: largest RMS error of the displacement over an oscillation
against the number of cells, by scheme and particles per cell and direction. Linear splines fail.
"""

import matplotlib.pyplot as plt
import numpy as np

from ..common.style import DEGREES, legend_below, line_style, scales, series, slope

NEEDS = ["verification.mms"]


def scale(results):
    return f"2D; {scales(results, NEEDS[0], '.order.')}"


def draw(results):
    table = results.table(NEEDS[0], "errors")
    counts = sorted(set(table["per_direction"]))
    figure, axes = plt.subplots(1, len(counts), sharey=True, squeeze=False,
                                figsize=(max(7.0, 3.0 * len(counts)), 3.8))
    for ax, count in zip(axes[0], counts, strict=True):
        for (transfer, degree, per), rows in series(
                table, ("transfer", "degree", "per_direction")).items():
            if per == count:
                ax.loglog(table["cells"][rows], np.minimum(table["error"][rows], 1.0),
                          **line_style(transfer, degree), label=f"{transfer} {DEGREES[degree]}")
        slope(ax, -2, (16, 64), 3e-3, "order 2")
        ax.set(title=f"{int(count)} particles per direction", xlabel="cells per side",
               xticks=(16, 32, 64), xticklabels=("16", "32", "64"), xlim=(14, 90))
        ax.minorticks_off()
    axes[0, 0].set_ylabel("error / A, cut at 1")
    legend_below(figure, axes[0], columns=5)
    return figure
