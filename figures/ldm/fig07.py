"""LDM, Figure 7: position error of the cylinder under gravity by the terms of the loss, r = 7, all
points, for the four schemes.
"""

import matplotlib.pyplot as plt
import numpy as np

from ..common.style import shared_scale

NEEDS = ["ldm.fig7"]
SCHEMES = {"lagrangian_nonlinear": "(a) Lagrangian, nonlinear",
           "eulerian_nonlinear": "(b) Eulerian, nonlinear",
           "lagrangian_linear": "(c) Lagrangian, linear", "eulerian_linear": "(d) Eulerian, linear"}
HIGHEST = 0.3       # end of the paper's colours [%]
DARK = 0.2          # colours of smaller errors are dark


def scale(results):
    return shared_scale(results, NEEDS[0])


def draw(results):
    table = results.table(NEEDS[0], "errors")
    known = [name for name in SCHEMES if name in table["scheme"]]
    figure, axes = plt.subplots(1, len(known), figsize=(2.6 * len(known) + 1.0, 2.8), squeeze=False)
    for ax, name in zip(axes[0], known, strict=True):
        error = square(table, name)
        image = ax.imshow(error, origin="lower", vmin=0.0, vmax=HIGHEST, cmap="viridis")
        for (v, F), value in np.ndenumerate(error):
            ax.text(F, v, f"{value:.3f}", ha="center", va="center", fontsize=8,
                    color="k" if value > DARK else "w")
        ax.set(title=SCHEMES[name], xticks=(0, 1), xticklabels=("without F", "with F"),
               yticks=(0, 1), yticklabels=("without v", "with v") if ax is axes[0, 0] else ("", ""))
        ax.title.set_fontsize(9)
        ax.grid(visible=False)
    figure.colorbar(image, ax=axes, label="position error [%]", shrink=0.8)
    return figure


def square(table, scheme):
    """Return the errors [%] by term: rows without and with v, columns without and with F."""
    error = np.full((2, 2), np.nan)
    for of, F, v, origin in zip(table["scheme"], table["F"], table["v"], table["origin"],
                                strict=True):
        if of == scheme:
            error[int(str(v) == "True"), int(str(F) == "True")] = 100.0 * origin
    return error
