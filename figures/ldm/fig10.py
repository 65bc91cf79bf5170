"""LDM, Figure 10: position error of the cylinder under gravity by number of sample points, latent
dimension and terms of the loss, for the four schemes; one draw of samples each. Crosses at the top
edge: runs that broke down; dotted: the most that the paper has with 10 to 100 points.
"""

import matplotlib.pyplot as plt
import numpy as np

from ..common.style import legend_below, series, shared_scale
from .fig07 import SCHEMES

NEEDS = ["ldm.fig10"]
LOSSES = {"both": ("F and v", "C0"), "no-F": ("without F", "C1"), "no-v": ("without v", "C2"),
          "neither": ("without both", "C3")}
MARKS = ("o", "s", "D", "^", "v")       # by latent dimension
GOOD = 1.0          # [%], with 10 to 100 points


def scale(results):
    return shared_scale(results, NEEDS[0])


def draw(results):
    table = results.table(NEEDS[0], "errors")
    known = [name for name in SCHEMES if name in table["scheme"]]
    figure, axes = plt.subplots(2, -(-len(known) // 2), figsize=(7.0, 6.4), sharex=True,
                                sharey=True, squeeze=False)
    for ax, name in zip(axes.flat, known, strict=False):
        panel(ax, table, name)
        ax.set_title(SCHEMES[name])
    for ax in axes[:, 0]:
        ax.set_ylabel("position error [%]")
    for ax in axes[-1]:
        ax.set_xlabel("sample points")
    legend_below(figure, axes.flat, columns=3)
    return figure


def panel(ax, table, scheme):
    """Plot the curves of a scheme: colours by loss, markers by latent dimension."""
    marks = dict(zip(sorted(set(table["r"])), MARKS, strict=False))
    ax.axhline(GOOD, color="0.4", lw=0.8, ls=":")
    for (r, loss), rows in series(table, ("r", "loss")).items():
        rows = rows & (table["scheme"] == scheme)
        rows = np.flatnonzero(rows)[np.argsort(table["points"][rows])]
        (words, colour), error = LOSSES[loss], 100.0 * table["origin"][rows]
        ax.loglog(table["points"][rows], np.where(np.isfinite(error), error, np.nan),
                  marks[r] + "-", color=colour, ms=4, fillstyle="none",
                  label=f"r = {r:.0f}, {words}")
        broken = table["points"][rows][~np.isfinite(error)]
        if len(broken):
            ax.plot(broken, np.full(len(broken), 0.97), "x", color=colour, ms=6,
                    transform=ax.get_xaxis_transform())
