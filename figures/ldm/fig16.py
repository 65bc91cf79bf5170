"""LDM, Figure 16: position error and wall time of reduced runs of the tower. Green: real time; red:
the full model, with the same transfer and (dashed) with the fastest there is. Filled: in single
precision. Runs that broke down are left out.
"""

import matplotlib.pyplot as plt
import numpy as np

from ..common.schemes import MARKS
from ..common.style import legend_below, series, shared_scale

NEEDS = ["ldm.fig16"]
RESAMPLED = {1: "P", 2: "D"}        # by quadrature points per cell and axis
DECADE = 10.0**0.5                  # up and down from the middle, at least
COLOURS = ("C0", "C1", "C4", "C5", "C6")


def scale(results):
    return shared_scale(results, NEEDS[0], ".error")


def draw(results):
    table = results.table(NEEDS[0], "ways")
    sizes = series(table, ("particles",))
    figure, axes = plt.subplots(1, len(sizes), figsize=(1.6 + 3.2 * len(sizes), 3.8),
                                squeeze=False, sharey=True)
    colours = dict(zip(sorted(set(table["points"])), COLOURS, strict=False))
    for ax, ((particles,), rows) in zip(axes[0], sizes.items(), strict=True):
        panel(ax, {name: column[rows] for name, column in table.items()}, colours)
        ax.set_title(f"{particles:.0f} particles", fontsize=9)
        ax.set_xlabel("wall time per second of the run [s]")
    axes[0, 0].set_ylabel("position error [%]")
    low, high = axes[0, 0].get_ylim()
    middle = np.sqrt(low * high)
    axes[0, 0].set_ylim(min(low, middle / DECADE), max(high, middle * DECADE))
    legend_below(figure, axes[0], columns=3)
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
                  color=colours[points], ms=7, fillstyle="full" if single else "none",
                  label=f"{words}, {points:.0f} samples" + ", single" * bool(single))
    ax.axvline(1.0, color="C2", label="real time")
    row = np.argmax(table["speed_up"])          # of a run that did not break down
    full = table["wall_per_second"][row] * table["speed_up"][row]
    fastest = full * table["wall_fastest"][row] / table["wall_full"][row]
    ax.axvline(full, color="C3", label="full model")
    ax.axvline(fastest, color="C3", ls="--", label="full model, fastest transfer")


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
