"""Compaction of an elastic column under its weight [CoombsAugarde2020]; see `columns`.

H = 50 m, rho0 = 80 kg/m^2, g = 10 m/s^2, nu = 0, and two stiffnesses: E = 1e6 Pa, where the column
is compressed by 4 % at its floor and particles cross cells, and E = 1e8 Pa, where they do not.
"""

from typing import NamedTuple

import numpy as np

from mpm_ref.materials import FixedCorotated, lame

from ..common.registry import experiment
from .columns import Column, settled, stress_errors
from .convergence import order
from .mms import name

SOFT = Column(FixedCorotated(*lame(1e6, 0.0)), height=50.0, rho0=80.0)
STIFF = Column(FixedCorotated(*lame(1e8, 0.0)), height=50.0, rho0=80.0)


class Series(NamedTuple):
    """A refinement study, and the order that is expected of it."""

    scheme: tuple
    column: str         # soft or stiff
    wall: bool
    expected: tuple | None      # band of the order; None: recorded only
    why: str = ""


METHOD = "the order of the method: no particle leaves its cell, and there is no wall"
CROSSING = "particles cross cells: the error of their sums is left; GIMP has about first order"
AT_WALL = ("first order: at any dx the stress in the cells at the wall is off by a fixed share of "
           "the floor's pressure (the largest error), because the splines of free nodes do not "
           "vanish at the wall")
AFFINE = ("first order at a particle: the MLS velocity gradient of a quadratic spline is not exact "
          "for quadratic fields; it is with cubic splines, and so is the gradient form (apic)")

QUICK = (
    Series(("mls", 3, 2), "stiff", False, (1.8, 2.3), METHOD),
    Series(("mls", 3, 2), "soft", False, (0.9, 2.3), CROSSING),
    Series(("mls", 3, 2), "soft", True, (0.8, 1.3), AT_WALL),
)
STANDARD = (
    *QUICK,
    Series(("apic", 2, 2), "stiff", False, (1.8, 2.3), METHOD),
    Series(("flip", 2, 2), "stiff", False, (1.8, 2.3), METHOD),
    Series(("mls", 2, 2), "stiff", False, (0.8, 1.3), AFFINE),
    Series(("mls", 2, 3), "stiff", False, (0.8, 1.3), AFFINE),
    Series(("mls", 2, 3), "soft", False, (0.8, 2.3), AFFINE),
    Series(("mls", 2, 2), "soft", True, (0.8, 1.3), AT_WALL),
    Series(("apic", 2, 2), "soft", True, (0.8, 1.3), AT_WALL),
    Series(("apic", 2, 2), "soft", False, None, CROSSING),
)


@experiment("verification.compaction", title="Elastic column under its weight",
            profiles=("quick", "standard"), budget={"quick": 10, "standard": 30})
def compaction(run):
    """Orders of the stress with and without a wall; linear splines as negative control."""
    cells = run.choose(quick=(8, 16, 32), standard=(8, 16, 32, 64))
    rows = []
    for series in run.progress(run.choose(quick=QUICK, standard=STANDARD), "series"):
        states, errors = refine(series.scheme, series.column, series.wall, cells)
        if series.column == "soft" and series.scheme == QUICK[0].scheme:
            record_profile(run, series, states[0])
        rows += [(*series.scheme, series.column, series.wall, n, *e)
                 for n, e in zip(cells, errors, strict=True)]
        record(run, series, cells, errors)
    run.table("errors", ("transfer", "degree", "per_direction", "column", "wall", "cells",
                         "mean_error", "largest_error"), rows)
    record_control(run, cells)


def refine(scheme, column, wall, cells):
    """States for numbers of cells over the height, and their mean and largest stress errors."""
    problem = SOFT if column == "soft" else STIFF
    states = [settled(problem, scheme, n, wall) for n in cells]
    return states, [stress_errors(problem, state) for state in states]


def record_profile(run, series, state):
    """Stress of the coarsest column over its height, both relative to the exact ones."""
    order = np.argsort(state.X, kind="stable")
    run.table("profile-wall" if series.wall else "profile-symmetric", ("X", "stress"),
              list(zip(state.X[order] / SOFT.height, state.stress[order] / SOFT.pressure,
                       strict=True)))


def record(run, series, cells, errors):
    """The order of a series."""
    held = "wall" if series.wall else "symmetric"
    rule = {"comparator": "band", "bound": series.expected} if series.expected else {
        "comparator": "info"}
    run.record(f"verification.compaction.{series.column}.{held}.{name(series.scheme)}.order",
               order([1.0 / n for n in cells], [mean for mean, _ in errors]), **rule,
               note=series.why,
               scale=f"{cells} cells over the height; mean error {errors[0][0]:.1e} to "
                     f"{errors[-1][0]:.1e}, largest {errors[-1][1]:.1e} at the finest")


def record_control(run, cells):
    """Linear splines."""
    (coarse, _), (fine, _) = refine(("flip", 1, 2), "soft", False, (cells[0], cells[-1]))[1]
    run.record("verification.compaction.soft.symmetric.flip-linear-2.growth", fine / coarse,
               comparator=">=", bound=1.0, scale=f"{cells[0]} and {cells[-1]} cells",
               note="negative control: the error of linear splines does not fall, because "
                    "particles cross cells; the ratio of the errors, which are cut at 100 %")
