"""Axial vibration of a bar. Left: amplitude of the coarsest run, 8 cells over the length, beside
the exact one. Right: largest RMS error of the displacement over four periods; free of walls it
falls with the second order of the method, at a sticky wall with the first order of the wall.
"""

import matplotlib.pyplot as plt

from ..common.style import DEGREES, TRANSFERS, legend_below, line_style, scales, series, slope

NEEDS = ["verification.bar"]


def scale(results):
    return f"strip one cell wide; {scales(results, NEEDS[0])}"


def draw(results):
    figure, (left, right) = plt.subplots(1, 2, figsize=(7.0, 3.8))
    for support, alpha in (("symmetric", 1.0), ("wall", 0.45)):
        history = results.table(NEEDS[0], f"history-{support}")
        left.plot(history["t"], history["ours"], color=TRANSFERS["mls"], alpha=alpha, label=support)
    left.plot(history["t"], history["exact"], "k:", label="exact")
    left.set(xlabel="t [s]", ylabel="velocity amplitude / V", ylim=(-1.1, 1.5))
    left.legend(fontsize=8, ncol=3, loc="upper center")
    table = results.table(NEEDS[0], "errors")
    for (transfer, degree, wall), rows in series(table, ("transfer", "degree", "wall")).items():
        support = "wall" if wall == "True" else "symmetric"
        right.loglog(table["cells"][rows], table["error"][rows], **line_style(transfer, degree),
                     mfc="w" if support == "wall" else None,
                     label=f"{transfer} {DEGREES[degree]}, {support}")
    cells = sorted(set(table["cells"]))
    slope(right, -2, (cells[0], cells[-1]), 0.05, "order 2")
    slope(right, -1, (cells[0], cells[-1]), 1.6, "order 1")
    right.set(xlabel="cells over the length", ylabel="displacement error / amplitude",
              xticks=cells, xticklabels=[f"{n:.0f}" for n in cells])
    right.minorticks_off()
    legend_below(figure, [right])
    return figure
