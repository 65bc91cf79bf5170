"""Column under its weight. Left: stress of the particles of the coarsest column, 8 cells high,
beside the exact line; the wall spoils the stress of the cells next to it. Right: mean error of the
stress, of a column that strains by 4 % (soft), where particles cross cells, and of one that hardly
strains (stiff); the numbers are particles per direction and cell.
"""

import matplotlib.pyplot as plt

from ..common.style import DEGREES, TRANSFERS, legend_below, line_style, scales, series, slope

NEEDS = ["verification.compaction"]


def scale(results):
    return f"strip one cell wide; {scales(results, NEEDS[0], 'order')}"


def draw(results):
    figure, (left, right) = plt.subplots(1, 2, figsize=(7.0, 3.8))
    left.plot((-1, 0), (0, 1), "k:", label="exact")
    for support, fill in (("symmetric", None), ("wall", "w")):
        profile = results.table(NEEDS[0], f"profile-{support}")
        left.plot(profile["stress"], profile["X"], "o", color=TRANSFERS["mls"], mfc=fill,
                  ms=4, label=support)
    left.set(xlabel="stress / pressure at the floor", ylabel="height X / H")
    left.legend(fontsize=8)
    table = results.table(NEEDS[0], "errors")
    keys = ("transfer", "degree", "per_direction", "column", "wall")
    for (transfer, degree, per, column, wall), rows in series(table, keys).items():
        support = "wall" if wall == "True" else "symmetric"
        right.loglog(table["cells"][rows], table["mean_error"][rows],
                     **line_style(transfer, degree, per), mfc="w" if wall == "True" else None,
                     alpha=0.5 if column == "soft" else 1.0,
                     label=f"{transfer} {DEGREES[degree]} {int(per)}, {column}, {support}")
    cells = sorted(set(table["cells"]))
    slope(right, -2, (cells[0], cells[-1]), 1.2e-3, "order 2")
    slope(right, -1, (cells[0], cells[-1]), 6e-2, "order 1")
    right.set(xlabel="cells over the height", ylabel="mean stress error / floor pressure",
              xticks=cells, xticklabels=[f"{n:.0f}" for n in cells])
    right.minorticks_off()
    legend_below(figure, [right], columns=3)
    return figure
