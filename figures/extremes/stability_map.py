"""Stability of explicit runs: time step against stiffness, for Poisson's ratios. Colours show how a
run ended. The line is the stable time step; a run past it is refused unless its problem allows it,
as all did here.
"""

import matplotlib.pyplot as plt
import numpy as np

from ..common.state_panels import finish
from ..common.style import scales

NEEDS = ["extremes.explicit.map"]
COLOURS = {"finished": "#cfe8cf", "energy": "#f0c36d", "J": "#b58fd1", "CFL": "#e07a6a",
           "not finite": "#444444", "out of range": "#000000"}
ENDS = {"energy": "energy grew", "J": "J out of bounds", "CFL": "crossed a cell in a step"}


def scale(results):
    return scales(results, NEEDS[0])


def draw(results):
    table = results.table(NEEDS[0], "runs")
    ratios = np.unique(table["nu"])
    columns = min(len(ratios), 3)
    rows = -(-len(ratios) // columns)
    figure, axes = plt.subplots(rows, columns, figsize=(7.0, 0.6 + 2.4 * rows), sharex=True,
                                sharey=True, squeeze=False, layout="constrained")
    for ax in axes.flat[len(ratios):]:
        ax.set_visible(False)
    for ax, nu in zip(axes.flat, ratios, strict=False):
        panel(ax, {name: a[table["nu"] == nu] for name, a in table.items()})
        ax.set_title(rf"$\nu$ = {nu:g}")
    for ax in axes[-1]:
        ax.set_xlabel("E [Pa]")
    for ax in axes[:, 0]:
        ax.set_ylabel("dt [s]")
    kinds = [kind for kind in COLOURS if kind in table["end"]]
    handles = [plt.Line2D([], [], marker="s", ls="", color=COLOURS[k], label=ENDS.get(k, k))
               for k in kinds]
    handles.append(plt.Line2D([], [], color="k", label="stable time step"))
    figure.legend(handles=handles, loc="outside lower center", ncols=len(handles))
    return finish(figure, (), None, "")


def panel(ax, runs):
    """Draw the runs at one Poisson's ratio."""
    ax.grid(False)
    for kind, colour in COLOURS.items():
        rows = runs["end"] == kind
        ax.plot(runs["E"][rows], runs["dt"][rows], "s", color=colour, ms=6)
    bound = runs["dt"] / runs["of_bound"]
    order = np.argsort(runs["E"])
    ax.plot(runs["E"][order], bound[order], "k-")
    ax.set(xscale="log", yscale="log")
    ax.set_ylim(runs["dt"].min() / 2, runs["dt"].max() * 2)
