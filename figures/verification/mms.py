"""Axis-aligned manufactured solution: largest RMS error of the displacement over an oscillation
against the number of cells, by scheme and particles per cell and direction. Linear splines fail.
"""

import matplotlib.pyplot as plt
import numpy as np

from ..common.style import DEGREES, legend_below, line_style, scales, series, slope

NEEDS = ["verification.mms"]
COLUMNS = 2


def scale(results):
    return f"2D; {scales(results, NEEDS[0], '.order.')}"


def draw(results):
    table = results.table(NEEDS[0], "errors")
    counts = sorted(set(table["per_direction"]))
    rows = -(-len(counts) // COLUMNS)
    figure, axes = plt.subplots(rows, COLUMNS, sharex=True, sharey=True, squeeze=False,
                                figsize=(7.0, 0.8 + 2.6 * rows))
    for ax in axes.flat[len(counts):]:
        ax.axis("off")
    for ax, count in zip(axes.flat, counts, strict=False):
        for (transfer, degree, per), rows in series(
                table, ("transfer", "degree", "per_direction")).items():
            if per == count:
                ax.loglog(table["cells"][rows], np.minimum(table["error"][rows], 1.0),
                          **line_style(transfer, degree), label=f"{transfer} {DEGREES[degree]}")
        slope(ax, -2, (16, 64), 3e-3, "order 2")
        ax.set(title=f"{int(count)} particles per direction", xlabel="cells per side",
               xticks=(16, 32, 64), xticklabels=("16", "32", "64"), xlim=(14, 90))
        ax.minorticks_off()
    for ax in axes[:, 0]:
        ax.set_ylabel("error / A, cut at 1")
    legend_below(figure, axes.flat, columns=5)
    return figure
