"""LDM, Figure 7: position error of the cylinder under gravity by the terms of the loss, r = 7, all
points, for the four schemes. The scale is logarithmic and goes to the largest error; the paper's
colours end at the line in it.
"""

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.colors import LogNorm

from ..common.state_panels import finish
from ..common.style import shared_scale

NEEDS = ["ldm.fig7"]
SCHEMES = {"lagrangian_nonlinear": "(a) Lagrangian, nonlinear",
           "eulerian_nonlinear": "(b) Eulerian, nonlinear",
           "lagrangian_linear": "(c) Lagrangian, linear", "eulerian_linear": "(d) Eulerian, linear"}
LOWEST, PRINTED = 0.1, 0.3      # ends of the paper's colours [%]
BRIGHT = 0.55       # of the scale, above which its colours are bright


def scale(results):
    return shared_scale(results, NEEDS[0])


def draw(results):
    table = results.table(NEEDS[0], "errors")
    known = [name for name in SCHEMES if name in table["scheme"]]
    errors = {name: square(table, name) for name in known}
    norm = LogNorm(min(LOWEST, *(np.nanmin(e) for e in errors.values())),
                   max(PRINTED, *(np.nanmax(e) for e in errors.values())))
    figure, axes = plt.subplots(2, -(-len(known) // 2), figsize=(6.0, 5.6), squeeze=False,
                                layout="constrained", sharex=True, sharey=True)
    for ax, name in zip(axes.flat, known, strict=False):
        image = ax.imshow(errors[name], origin="lower", norm=norm, cmap="viridis")
        for (v, F), value in np.ndenumerate(errors[name]):
            ax.text(F, v, f"{value:.3f}", ha="center", va="center",
                    color="k" if norm(value) > BRIGHT else "w")
        ax.set(title=SCHEMES[name], xticks=(0, 1), xticklabels=("without F", "with F"),
               yticks=(0, 1), yticklabels=("without v", "with v"))
        ax.grid(visible=False)
    bar = figure.colorbar(image, ax=axes, label="position error [%]", shrink=0.7)
    bar.ax.axhline(PRINTED, color="w", lw=2.0)
    bar.ax.yaxis.set_major_formatter("{x:g}")
    bar.ax.yaxis.set_minor_formatter("{x:.1g}")
    bar.ax.tick_params(which="both", labelsize=8)
    return finish(figure, (), None, "")


def square(table, scheme):
    """Return the errors [%] by term: rows without and with v, columns without and with F."""
    error = np.full((2, 2), np.nan)
    for of, F, v, origin in zip(table["scheme"], table["F"], table["v"], table["origin"],
                                strict=True):
        if of == scheme:
            error[int(str(v) == "True"), int(str(F) == "True")] = 100.0 * origin
    return error
