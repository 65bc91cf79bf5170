"""NSF, Figure 18: where the time of a reduced step goes, cake and metal frame; the areas are those
of the times. The paper's parts "network, projection" are here the first two and the last.
"""

import matplotlib.pyplot as plt
import numpy as np

from ..common.style import legend_below, scales

NEEDS = ["nsf.speed"]
PARTS = {"integration": "finding and placing points", "inferred": "velocity, stress, affine field",
         "moved": "step of the grid", "inverted": "inversion"}


def scale(results):
    return scales(results, NEEDS[0])


def draw(results):
    table = results.table(NEEDS[0], "times")
    rows = [first(table, scene) for scene in ("cake", "metal") if scene in table["scene"]]
    most = max(table["reduced"][k] for k in rows)
    figure, axes = plt.subplots(1, len(rows), figsize=(3.5 * len(rows), 3.8), squeeze=False)
    for ax, k in zip(axes.flat, rows, strict=True):
        spent = [1e3 * table[part][k] for part in PARTS]
        wedges, *_ = ax.pie(spent, radius=np.sqrt(table["reduced"][k] / most), startangle=90,
                            labels=[f"{ms:.3g} ms" for ms in spent])
        for wedge, label in zip(wedges, PARTS.values(), strict=True):
            wedge.set_label(label)
        ax.set_title(f"{table['scene'][k]}, {table['samples'][k]:g} samples: "
                     f"{1e3 * table['reduced'][k]:.3g} ms a step", fontsize=9)
    legend_below(figure, axes.flat)
    return figure


def first(table, scene):
    """Return the row of a scene's most samples and Gauss-Newton."""
    rows = np.flatnonzero((table["scene"] == scene) & (table["inversion"] == "nonlinear"))
    return rows[np.argmax(table["samples"][rows])]
