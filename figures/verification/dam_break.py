"""Dam break: front (foremost particle, dotted: what 99 % of the water lie behind) over time, with
Ritter's bound and the points measured by Martin and Moyce as others read them (unconfirmed).
"""

import matplotlib.pyplot as plt

from ..common.style import scales, series, shades

NEEDS = ["verification.dam_break"]


def scale(results):
    return f"2D; {scales(results, NEEDS[0])}"


def draw(results):
    table, points = (results.table(NEEDS[0], name) for name in ("front", "measured"))
    figure, ax = plt.subplots(figsize=(6.0, 4.0))
    runs = series(table, ("cells",))
    for ((cells,), rows), color in zip(runs.items(), shades(len(runs)), strict=True):
        ax.plot(table["T"][rows], table["Z"][rows], color=color, label=f"dx = a/{int(cells)}")
        ax.plot(table["T"][rows], table["bulk"][rows], ":", color=color)
    ax.plot(table["T"][rows], table["ritter"][rows], "k--", lw=1, label="Ritter, upper bound")
    ax.plot(points["T"], points["Z"], "ks", mfc="w", ms=5, label="measured (unconfirmed)")
    ax.set(xlabel="t sqrt(2 g/a)", ylabel="front x/a")
    ax.legend(fontsize=8)
    return figure
