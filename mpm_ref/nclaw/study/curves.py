"""Stress-strain curves of learned and true laws along one-element paths: computed, written as CSV,
and drawn. Matplotlib is imported when a picture is drawn.
"""

from itertools import groupby
from math import nan
from typing import NamedTuple

import numpy as np

from ...materials import NoFlow
from ...materials.learned.strain_range import within_bounds
from ...store.atomic import replacing
from ..paths import StrainPath, cycles, monotone, path_response, path_stress
from .compare import write_rows

PANEL, ROOM = (3.1, 2.7), 0.8   # width and height of a panel; for the title and the legend [inch]
COLUMNS = 3
TRUTH, LEARNED = "0.6", "C3"    # colours
STYLES = {True: "-", False: ":"}


class Curve(NamedTuple):
    """Stresses along a path."""

    path: StrainPath
    dt: float               # [s] of a step
    truth: np.ndarray       # (k + 1,) [Pa]
    learned: np.ndarray     # (k + 1,) [Pa]; NaN where the law broke down
    in_range: np.ndarray | None     # (k + 1,) whether strains are in range of training, or None

    @property
    def error(self):
        """The largest difference over the largest true stress; NaN without true stress, or where
        the learned law broke down.
        """
        largest = np.abs(self.truth).max()
        return float(np.abs(self.learned - self.truth).max() / largest) if largest > 0.0 else nan

    @property
    def range_exit(self):
        """The first strain of the path out of the range of training, or None."""
        outside = () if self.in_range is None else np.flatnonzero(~self.in_range)
        return float(self.path.strain[outside[0]]) if len(outside) else None

    @property
    def failure(self):
        """The strain at which the learned law first gives no finite stress, or None."""
        at = np.flatnonzero(~np.isfinite(self.learned))
        return float(self.path.strain[at[0]]) if len(at) else None


def compare_curves(truth, learned, paths, dt, bounds=None):
    """Return [`Curve`] of paths. truth, learned: (law, flow) each; dt [s] of a step; bounds:
    strains that training (see `learned.strain_range`), if known.
    """
    curves = []
    for path in paths:
        true, ours = (path_response(*laws, path, dt) for laws in (truth, learned))
        inside = None if bounds is None else within_bounds(ours.F, bounds)
        curves.append(Curve(path, dt, path_stress(path, true), path_stress(path, ours), inside))
    return curves


def paths_for(flows, d, strain, steps):
    """Return the paths to strains of this size: monotone ones, and cycles if there is a flow."""
    flowing = any(not isinstance(flow, NoFlow) for flow in flows)
    return monotone(d, strain, steps) + (cycles(d, strain, steps) if flowing else [])


def write_curves(curves, out):
    """Write `Curve`s as CSV: a row for each time level. Stresses are in Pa; `in_range`
    is 1 or 0, empty where it is not known.
    """
    rows = ((curve.path.name, k * curve.dt, curve.path.strain[k], curve.path.symbol,
             curve.truth[k], curve.learned[k],
             "" if curve.in_range is None else int(curve.in_range[k]))
            for curve in curves for k in range(len(curve.truth)))
    write_rows(("path", "t", "strain", "stress", "truth", "learned", "in_range"), rows, out)


def draw_curves(curves, title, out):
    """Write a picture of `Curve`s, a panel for each name of a path: png, pdf or svg."""
    from matplotlib.figure import Figure

    panels = {name: list(own) for name, own in groupby(curves, lambda curve: curve.path.name)}
    columns = min(len(panels), COLUMNS)
    rows = -(-len(panels) // columns)
    figure = Figure(figsize=(PANEL[0] * columns, PANEL[1] * rows + ROOM), layout="constrained")
    for k, (name, own) in enumerate(panels.items(), 1):
        axes = figure.add_subplot(rows, columns, k)
        for curve in own:
            draw_curve(axes, curve)
        axes.set(xlabel="strain", ylabel=f"{own[0].path.symbol} [Pa]", title=name)
        axes.ticklabel_format(axis="y", scilimits=(-3, 3))
        axes.locator_params(axis="x", nbins=5)
    figure.suptitle(title, fontsize=9)
    add_legend(figure, curves)
    with replacing(out) as part:
        figure.savefig(part)


def draw_curve(axes, curve):
    """Draw both stresses; the learned one dotted beyond the strains of training."""
    strain = curve.path.strain
    axes.plot(strain, curve.truth, "-", color=TRUTH, lw=3.0)
    in_range = np.ones(len(strain), bool) if curve.in_range is None else curve.in_range
    for inside, style in STYLES.items():
        shown = in_range == inside
        shown[:-1] |= shown[1:]         # lines reach from one kind of point to the next
        axes.plot(strain, np.where(shown, curve.learned, nan), style, color=LEARNED, lw=1.4)


def add_legend(figure, curves):
    """Add a legend below the panels."""
    from matplotlib.lines import Line2D

    known = curves[0].in_range is not None
    words = {"truth": ("-", TRUTH), "learned": (STYLES[True], LEARNED)}
    if known:
        words["learned, beyond the strains of training"] = STYLES[False], LEARNED
    lines = [Line2D([], [], ls=style, color=color) for style, color in words.values()]
    figure.legend(lines, list(words), loc="outside lower center", ncols=3, fontsize=8,
                  title=None if known else "the weights do not say which strains training saw",
                  title_fontsize=8)
