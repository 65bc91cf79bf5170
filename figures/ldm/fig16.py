"""LDM, Figure 16: position error and wall time of reduced runs of the tower, by their size; markers
tell the scheme, colours the number of samples. Lines: real time, and the full model with
the same transfer and with the fastest there is. A red cross at the top: a run that broke down.
"""

import matplotlib.pyplot as plt
import numpy as np

from ..common.schemes import MARKS
from ..common.style import legend_below, readable, series, shared_scale
from ..common.training_errors import mark_broken

NEEDS = ["ldm.fig16"]
RESAMPLED = {1: "P", 2: "D"}        # by quadrature points per cell and axis
RANGE = 2.0                         # up and down from the middle of errors, at least
COLOURS = ("C0", "C1", "C4", "C5", "C6")
WIDTH, HEIGHT = 7.0, 3.0            # of the figure [inch]
LINES = {"real time": ("C2", "-"), "full model": ("C3", "-"),
         "full model, fastest transfer": ("C3", "--")}


def scale(results):
    return shared_scale(results, NEEDS[0], ".error")


def draw(results):
    table = results.table(NEEDS[0], "ways")
    sizes = series(table, ("particles",))
    figure, axes = plt.subplots(1, len(sizes), figsize=(WIDTH, HEIGHT), squeeze=False, sharey=True)
    colours = dict(zip(sorted(set(table["points"])), COLOURS, strict=False))
    for ax, ((particles,), rows) in zip(axes[0], sizes.items(), strict=True):
        panel(ax, {name: column[rows] for name, column in table.items()}, colours)
        ax.set_title(f"{particles:,.0f} particles".replace(",", " "))
        readable(ax.xaxis, (1.0,))
    figure.supxlabel("wall time for a second of the run [s]", fontsize=9)
    axes[0, 0].set_ylabel("position error [%]")
    low, high = axes[0, 0].get_ylim()
    middle = np.sqrt(low * high)
    axes[0, 0].set_ylim(min(low, middle / RANGE), max(high, middle * RANGE))
    readable(axes[0, 0].yaxis)
    proxies(axes[0, 0], table, colours)
    legend_below(figure, axes[0, :1], columns=3)
    return figure


def panel(ax, table, colours):
    """Plot all runs at one size: markers by scheme, filled in single precision, colours by number
    of samples.
    """
    for (scheme, points, per_cell, single), rows in series(
            table | scheme_columns(table), ("scheme", "points", "per_cell", "single")).items():
        words, mark = label_and_marker(scheme, per_cell)
        good = rows & np.isfinite(table["origin"])
        ax.loglog(table["wall_per_second"][good], 100.0 * table["origin"][good], mark,
                  color=colours[points], ms=6, fillstyle="full" if single else "none",
                  label=f"_{words}, {points:.0f} samples" + ", single" * bool(single))
    broken = ~np.isfinite(table["origin"]) & np.isfinite(table["wall_per_second"])
    mark_broken(ax, table["wall_per_second"][broken], "r")
    row = np.argmax(table["speed_up"])          # of a run that did not break down
    full = table["wall_per_second"][row] * table["speed_up"][row]
    fastest = full * table["wall_fastest"][row] / table["wall_full"][row]
    for (label, (colour, dashes)), x in zip(LINES.items(), (1.0, full, fastest), strict=True):
        ax.axvline(x, color=colour, ls=dashes, label=label)


def proxies(ax, table, colours):
    """Add empty curves whose labels say what markers, colours and fillings mean."""
    columns = table | scheme_columns(table)
    marks = dict(label_and_marker(scheme, per_cell)
                 for scheme, per_cell in series(columns, ("scheme", "per_cell")))
    for label, mark in marks.items():
        ax.plot([], [], mark, color="k", ms=6, fillstyle="none", label=label)
    for points, colour in colours.items():
        ax.plot([], [], "s", color=colour, ms=6, label=f"{points:.0f} samples")
    if columns["single"].any():
        ax.plot([], [], "o", color="0.5", ms=6, label="filled: single precision")


def scheme_columns(table):
    """Return further columns: the scheme, as targets name it, and whether precision is single."""
    names = zip(table["quadrature"], table["projection"], strict=True)
    double = np.full(len(table["quadrature"]), "double")
    return {"scheme": np.array(["_".join(name) for name in names]),
            "single": table.get("precision", double) == "single"}


def label_and_marker(scheme, per_cell):
    """Return label and marker of a scheme, or of quadrature with another sampling."""
    if scheme in MARKS:
        return MARKS[scheme]
    quadrature, projection = scheme.split("_")
    return (f"{quadrature.capitalize()} with {per_cell:.0f}³ per cell, {projection}",
            RESAMPLED.get(int(per_cell), "h"))
