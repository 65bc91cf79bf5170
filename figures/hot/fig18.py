"""HOT, Figure 18: residuals |g_i|/kappa_i of the nodes in the middle plane of a stretched box, at
iterations of HOT (top) and LBFGS-H (bottom), on one logarithmic scale. The last of each row is the
end of its solve.
"""

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.colors import LogNorm

NEEDS = ["hot.fig18"]
METHODS = {"hot": "HOT", "lbfgs-h": "LBFGS-H"}
LEAST = 1e-9        # colour of what is smaller still


def scale(results):
    return next(r.scale for r in results.records(NEEDS[0]) if r.target == "hot.fig18.hot_iters")


def draw(results):
    table = results.table(NEEDS[0], "slice")
    most = max(len(iterations(table, method)) for method in METHODS)
    figure, axes = plt.subplots(2, most, figsize=(7.0, 4.2), squeeze=False,
                                layout="constrained")
    norm = LogNorm(LEAST, table["residual"].max())
    for row, (method, label) in zip(axes, METHODS.items(), strict=True):
        for ax in row:
            ax.axis("off")
        for ax, k in zip(row, iterations(table, method), strict=False):
            image = panel(ax, table, (table["method"] == method) & (table["iteration"] == k), norm)
            ax.set_title(f"{label}, iteration {k:.0f}")
    figure.colorbar(image, ax=axes, shrink=0.8, label="residual of a node")
    figure.draw_without_rendering()         # lays out, so that the scale goes below
    figure.set_layout_engine("none")
    return figure


def iterations(table, method):
    """Return the iterations of a method, in order."""
    return np.unique(table["iteration"][table["method"] == method])


def panel(ax, table, rows, norm):
    """Draw the chosen rows, one plane, as an image."""
    x, y = (table[name][rows].astype(int) for name in ("x", "y"))
    image = np.full((np.ptp(y) + 1, np.ptp(x) + 1), np.nan)
    image[y - y.min(), x - x.min()] = np.maximum(table["residual"][rows], LEAST)
    return ax.imshow(image, origin="lower", norm=norm, cmap="turbo")
