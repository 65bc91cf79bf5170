"""NCLaw: errors of small trainings, which see a run in few points on a coarse grid. Left: against
the CPU time of the training, in the body of the paper where they were run there, else on the run
that they learned from; curves go over epochs, which stand beside them, marks differ from the star
in what the legend says; the dotted line joins what nothing beats. Middle: by what is seen of the
run, on that run (full marks) and thrown otherwise (open ones); the grey band is of trainings that
see all, by seed. Right: by the width of the networks, against the CPU time of an answer. What broke
down is left out.
"""

from itertools import cycle

import matplotlib.pyplot as plt
import numpy as np

from validation.nclaw.observation import Seen
from validation.nclaw.small_trainings import Small

from ..common.dots import below, dots, named
from ..common.orders import OTHERS, scales, series
from ..nclaw.loss import COLOURS
from .ldm import MARKS, readable

NEEDS = ["trade.nclaw.training", "trade.nclaw.sight", "trade.nclaw.width"]
TITLES = ("training", "what is seen", "width of the networks")
SIZES = {"edge": "{:g}³ points", "cells": "{:g} cells", "epochs": "{:g} epochs",
         "last": "horizon to {:g}"}
SIGHTS = {"positions": "places alone", "every": "frames {:g} steps apart",
          "share": "{:.2g} of the points", "noise": "{:g} m off"}


def scale(results):
    return scales(results, NEEDS[1])


def draw(results):
    figure, axes = plt.subplots(1, 3, figsize=(13.0, 5.4), width_ratios=(5, 3, 4),
                                layout="constrained")
    trainings(axes[0], results.table(NEEDS[0], "trainings"))
    sights(axes[1], results.table(NEEDS[1], "trainings"))
    widths(axes[2], results.table(NEEDS[2], "widths"))
    for ax, title in zip(axes, TITLES, strict=True):
        ax.set_title(title, fontsize=9)
    for ax in axes[::2]:
        readable(ax.xaxis, (1.0, 2.0, 5.0))
        ax.set_ylabel("error [m²]")
    axes[2].legend(fontsize=7)
    return below(figure, axes[:2], 5)


def trainings(ax, table):
    """A curve for each training of several epochs, a mark for each of the others."""
    error = np.where(np.isnan(table["full"]), table["own"], table["full"])
    x, looks, seen = table["cpu"], cycle(zip(MARKS, cycle(OTHERS))), set()
    for (name,), rows in series(table, ("environment",)).items():
        best = np.flatnonzero(rows & (table["pareto"] == 1))
        best = best[np.argsort(x[best])]
        ax.loglog(x[best], error[best], ":", color=COLOURS[name], zorder=0)
    for _, rows in series(table, ("name",)).items():
        k = np.flatnonzero(rows)[0]
        if rows.sum() > 1:
            name = table["environment"][k]
            ax.plot(x[rows], error[rows], ".-", color=COLOURS[name], label=f"{name}, by epochs")
            annotated(ax, (x[rows], error[rows]), table["epoch"][rows])
            continue
        words = named(table, k, SIZES, Small()) or "star"
        mark, colour = ("*", "k") if words == "star" else next(looks)
        ax.plot(x[k], error[k], mark, color=colour, ms=10 if words == "star" else 6,
                fillstyle="full" if words == "star" else "none",
                label=None if words in seen else sized(words))
        seen.add(words)
    ax.set_xlabel("CPU time of the training [s]")


def sized(words):
    """The legend of a mark."""
    if words != "star":
        return words
    return f"{', '.join(form.format(getattr(Small(), key)) for key, form in SIZES.items())}"


def sights(ax, table):
    """A row for each training that does not see all."""
    words = [named(table, k, SIGHTS, Seen()) for k in range(len(table["own"]))]
    dots(ax, table, words)


def widths(ax, table):
    """Errors on the run that was learned from, and thrown otherwise."""
    rows = np.argsort(table["width"])
    x = 1e6 * table["cpu_point"][rows]
    for key, style, words in (("own", "o-", "on the run that it learned from"),
                              ("thrown", "s--", "thrown otherwise")):
        ax.loglog(x, table[key][rows], style, color="k", ms=5, fillstyle="none", label=words)
    annotated(ax, (x, table["own"][rows]), table["width"][rows])
    ax.axvline(1e6 * table["true_cpu_point"][0], ls=":", color="0.4", label="the true laws")
    ax.set_xlabel("CPU time of an answer [µs]")


def annotated(ax, at, values):
    """Numbers beside the points at (x, y) that are finite."""
    for a, b, value in zip(*at, values, strict=True):
        if np.isfinite(b):
            ax.annotate(f"{value:g}", (a, b), fontsize=7, xytext=(3, 5),
                        textcoords="offset points")
