"""Left: a cantilever whose end sinks by half its length, 4 cells high, with its axis by the
elastica. Right: distance of that end from the elastica's, by scheme; and for a small load the error
of the deflection by Timoshenko's beam. Both relative to the deflection.
"""

import matplotlib.pyplot as plt
import numpy as np

from ..common.style import DEGREES, TRANSFERS, counts, legend_below, line_style, series

NEEDS = ["verification.cantilever"]


def scale(results):
    large, small = (results.table(NEEDS[0], name) for name in ("large", "small"))
    return (f"2D, {counts(large['cells'])} cells over the height; small load: "
            f"{counts(small['cells'])}")


def draw(results):
    figure, (left, right) = plt.subplots(1, 2, figsize=(7.0, 3.8), width_ratios=(1.3, 1))
    places, axis = (results.table(NEEDS[0], name) for name in ("places", "elastica"))
    left.plot(places["x"], places["y"], ".", color="C0", ms=2, label="particles")
    left.plot(axis["x"], axis["y"], "k-", lw=1, label="elastica")
    left.axvline(0.0, color="0.5", lw=4, alpha=0.4)
    left.set(xlabel="x [m]", ylabel="y [m]", aspect="equal")
    left.legend(fontsize=8)
    table = results.table(NEEDS[0], "large")
    for (transfer, degree, per), rows in series(
            table, ("transfer", "degree", "per_direction")).items():
        right.plot(table["cells"][rows], table["error"][rows], **line_style(transfer, degree, per),
                   label=f"{transfer} {DEGREES[degree]}, {int(per)} per direction")
    small = results.table(NEEDS[0], "small")
    right.plot(small["cells"], np.abs(small["error"]), "^:", color=TRANSFERS["mls"], ms=4,
               label="small load, mls quadratic")
    right.set(xlabel="cells over the height", ylabel="error / deflection", ylim=(0.0, None),
              xticks=sorted({*table["cells"], *small["cells"]}))
    legend_below(figure, [right])
    return figure
