"""NCLaw: errors of small trainings, on a run of few points on a coarse grid. Above: against the CPU
time of the training, in the body of the paper where they were run there, else on the training run;
curves go over epochs (their labels), marks differ from the star as the legend shows; the dotted
line is the Pareto front. Below, left: by what is observed of the run, on that run (full marks) and
thrown differently (open marks); the grey band is of trainings on full observations, by seed. Right:
by the width of the networks, against the CPU time of an evaluation. Crosses at the edge of large
errors: runs that broke down.
"""

from itertools import cycle

import matplotlib.pyplot as plt
import numpy as np

from validation.nclaw.observation import Observation
from validation.nclaw.small_trainings import Small

from ..common.style import OTHERS, readable, scales, series
from ..common.training_errors import differences, error_rows, legend_outside, mark_broken
from ..nclaw.loss import COLOURS
from .ldm import MARKS

NEEDS = ["trade.nclaw.training", "trade.nclaw.sight", "trade.nclaw.width"]
TITLES = ("training", "observations", "width of the networks")
SIZES = {"edge": "{:g}³ points", "cells": "{:g} cells", "epochs": "{:g} epochs",
         "last": "horizon to {:g}"}
OBSERVATIONS = {"positions": "positions only", "every": "a frame every {:g} steps",
                "share": "{:.2g} of the points", "noise": "{:g} m of noise"}


def scale(results):
    return scales(results, NEEDS[1])


def draw(results):
    figure, panels = plt.subplot_mosaic([["above", "above"], ["left", "right"]],
                                        figsize=(7.0, 7.6), layout="constrained")
    axes = list(panels.values())
    trainings(axes[0], results.table(NEEDS[0], "trainings"))
    observations(axes[1], results.table(NEEDS[1], "trainings"))
    widths(axes[2], results.table(NEEDS[2], "widths"))
    for ax, title in zip(axes, TITLES, strict=True):
        ax.set_title(title)
    for ax in axes[::2]:
        readable(ax.xaxis, (1.0, 2.0, 5.0))
        ax.set_ylabel("error [m²]")
    axes[2].legend(fontsize=7)
    return legend_outside(figure, axes[:2], 3)


def trainings(ax, table):
    """Draw a curve for each training of several epochs, a mark for each of the others."""
    error = np.where(np.isnan(table["full"]), table["own"], table["full"])
    x, styles, labelled = table["cpu"], cycle(zip(MARKS, cycle(OTHERS))), set()
    for (name,), rows in series(table, ("environment",)).items():
        best = np.flatnonzero(rows & (table["pareto"] == 1))
        best = best[np.argsort(x[best])]
        ax.loglog(x[best], error[best], ":", color=COLOURS[name], zorder=0)
    for _, rows in series(table, ("name",)).items():
        k = np.flatnonzero(rows)[0]
        if rows.sum() > 1:
            name = table["environment"][k]
            ax.plot(x[rows], error[rows], ".-", color=COLOURS[name], label=f"{name}, by epochs")
            annotate_points(ax, (x[rows], error[rows]), table["epoch"][rows])
            mark_broken(ax, x[rows & ~np.isfinite(error)], COLOURS[name])
            continue
        words = differences(table, k, SIZES, Small()) or "star"
        mark, colour = ("*", "k") if words == "star" else next(styles)
        ax.plot(x[k], error[k], mark, color=colour, ms=10 if words == "star" else 6,
                fillstyle="full" if words == "star" else "none",
                label=None if words in labelled else size_label(words))
        labelled.add(words)
    ax.set_xlabel("CPU time of the training [s]")


def size_label(difference):
    """Return the legend of a mark: its difference from the star, or the sizes of the star."""
    if difference != "star":
        return difference
    return f"{', '.join(form.format(getattr(Small(), key)) for key, form in SIZES.items())}"


def observations(ax, table):
    """Draw a row for each training on reduced observations."""
    labels = [differences(table, k, OBSERVATIONS, Observation()) for k in range(len(table["own"]))]
    error_rows(ax, table, labels)


def widths(ax, table):
    """Draw the errors on the training run, and thrown differently."""
    rows = np.argsort(table["width"])
    x = 1e6 * table["cpu_point"][rows]
    for key, style, label in (("own", "o-", "on the training run"),
                              ("thrown", "s--", "thrown differently")):
        ax.loglog(x, table[key][rows], style, color="k", ms=5, fillstyle="none", label=label)
    annotate_points(ax, (x, table["own"][rows]), table["width"][rows])
    mark_broken(ax, x[~np.isfinite(table["own"][rows])], "k")
    ax.axvline(1e6 * table["true_cpu_point"][0], ls=":", color="0.4", label="the true laws")
    ax.set_xlabel("CPU time of an evaluation [µs]")


def annotate_points(ax, points, values):
    """Write numbers next to the points (x, y) that are finite."""
    for a, b, value in zip(*points, values, strict=True):
        if np.isfinite(b):
            ax.annotate(f"{value:g}", (a, b), fontsize=7, xytext=(3, 5),
                        textcoords="offset points")
