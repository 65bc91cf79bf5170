"""HOT, Figure 8: non-zeros per row and in all, by level, of hierarchies for armadillo and cat:
node embedding with the linear and the quadratic kernel, and grids to which the particles go anew.
Crosses are printed; they belong to 403 000 particles.
"""

import matplotlib.pyplot as plt

from validation.common import targets

from ..common.style import legend_below, series, shared_scale

NEEDS = ["hot.fig8"]
KINDS = {"linear": ("linear embedding", "C0", "o-"),
         "quadratic": ("quadratic embedding", "C2", "s-"),
         "geometric": ("geometric", "C1", "^--")}
PRINTED = {("l0", 0): "C0", ("l4", 4): "C0", ("gmg4", 4): "C1"}


def scale(results):
    return shared_scale(results, NEEDS[0])


def draw(results):
    table = results.table(NEEDS[0], "levels")
    printed = targets.load()
    figure, axes = plt.subplots(1, 2, figsize=(7.0, 3.4))
    for kind, rows in series(table, ("kind",)).items():
        label, color, style = KINDS[kind[0]]
        for ax, name in zip(axes, ("per_row", "nonzeros"), strict=True):
            ax.plot(table["level"][rows], table[name][rows], style, color=color, label=label)
    for (short, level), color in PRINTED.items():
        for ax, name in zip(axes, ("nnz_row", "nnz"), strict=True):
            ax.plot(level, printed[f"hot.fig8.{short}.{name}"].value, "x", color=color, ms=9, mew=2)
    axes[0].set(ylabel="non-zeros per row", ylim=(0.0, None))
    axes[1].set(ylabel="non-zeros", yscale="log")
    for ax in axes:
        ax.set(xlabel="level", xticks=sorted(set(table["level"])))
    legend_below(figure, axes, columns=3)
    return figure
