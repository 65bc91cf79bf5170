"""NSF: position error of reduced runs with inferred stress. Left: by the number of samples, drawn
at random or with weights by cubature, or by that of cells whose points have such weights; a mark is
the mean over draws and tests, a bar goes from the smallest to the largest; the dotted line is where
all particles are samples. Right: by the length of the step over that of the scene. Runs that broke
down are left out.
"""

import matplotlib.pyplot as plt
import numpy as np

from ..common.style import legend_below, readable, scales, series

NEEDS = ["trade.nsf.samples", "trade.nsf.dt"]
TITLES = ("samples", "time step")
COLOURS = {"jelly": "C0", "metal": "C3"}
STYLES = {"random": "o-", "cubature": "s--", "cells": "^:"}


def scale(results):
    return scales(results, NEEDS[0])


def draw(results):
    figure, axes = plt.subplots(1, 2, figsize=(7.0, 3.8), width_ratios=(3, 2), sharey=True)
    samples(axes[0], results.table(NEEDS[0], "samples"))
    steps(axes[1], results.table(NEEDS[1], "steps"))
    for ax, title in zip(axes, TITLES, strict=True):
        ax.set_title(title)
        ax.set(xscale="log", yscale="log")
        readable(ax.xaxis)
    readable(axes[0].yaxis, (1.0, 2.0, 5.0))
    axes[0].set(xlabel="samples, or cells of these, at most", ylabel="position error [%]")
    axes[1].set_xlabel("step over that of the scene")
    legend_below(figure, axes)
    return figure


def samples(ax, table):
    """Draw a curve for each scene and sampling, and a line where all particles are samples."""
    most = {scene: table["samples"][rows].max() for (scene,), rows in
            series(table, ("scene",)).items()}
    for (scene, word), rows in series(table, ("scene", "fields")).items():
        few = rows & (table["samples"] < most[scene])
        curve(ax, table, "samples", few, fmt=STYLES[word], color=COLOURS[scene],
              label=f"{scene}, {word}")
    for scene, count in most.items():
        everything = (table["scene"] == scene) & (table["samples"] == count)
        ax.axhline(100.0 * table["origin"][everything].mean(), ls=":", color=COLOURS[scene],
                   label=f"{scene}, all {count:g} particles")


def steps(ax, table):
    """Draw a curve for each scene."""
    for (scene,), rows in series(table, ("scene",)).items():
        curve(ax, table, "faster", rows, fmt="o-", color=COLOURS[scene])


def curve(ax, table, name, rows, **style):
    """Draw means of the finite errors over a column, with bars from the smallest to the largest."""
    rows = rows & np.isfinite(table["origin"])
    x = np.unique(table[name][rows])
    errors = [100.0 * table["origin"][rows & (table[name] == a)] for a in x]
    middle = np.array([e.mean() for e in errors])
    ends = np.array([[e.min(), e.max()] for e in errors]).reshape(-1, 2).T
    ax.errorbar(x, middle, np.abs(ends - middle), ms=4, lw=1, capsize=2, fillstyle="none", **style)
