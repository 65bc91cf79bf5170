"""Columns of matter that settle under their weight and cannot widen.

A column stands along x, from a floor at x = 0 to a free surface at x = H. At rest the stress along
it balances the weight above, whatever the law: P_xx(X) = -rho0 g (H - X). The floor is there in two
ways: as a sticky wall, and without a wall by symmetry, as the middle of a column from -H to H whose
weight points to its middle everywhere.

*Compaction* of an elastic column [CoombsAugarde2020]: H = 50 m, rho0 = 80 kg/m^3, g = 10 m/s^2,
nu = 0, and two stiffnesses: E = 1e6 Pa, where the column is compressed by 4 % at its floor and
particles cross cells, and E = 1e8 Pa, where they do not.

*Hydrostatic* pressure of weakly compressible water: with tau = lam J (J - 1) the pressure is
p = -tau/J = lam (1 - J). At rest it is that of the water above a particle, which sits deeper than
in incompressible water, since dx = J dX:

    p = rho0 g (H - X),     x = X - rho0 g (H X - X^2/2) / lam

H = 2 m, rho0 = 1000 kg/m^3; lam is such that sound has 10 times the speed sqrt(2 g H), as
weakly compressible codes take it: at the floor J = 1 - 1/200.
"""

from math import pi, sqrt
from typing import NamedTuple

import numpy as np

from mpm_ref.core.grid import OutOfRange
from mpm_ref.materials import FixedCorotated, Fluid, lame, stiffness

from ..common.registry import experiment
from .convergence import order
from .lattice import ON_WALL, strip, strip_stepper
from .mms import name
from .settle import Pace, settle

CFL = 0.4


class Column(NamedTuple):
    """A column: its law, its height, its density and gravity."""

    law: tuple
    height: float       # H at rest [m]
    rho0: float         # [kg/m^3]
    g: float = 10.0     # [m/s^2]

    @property
    def pressure(self):
        """Return the pressure at the floor [Pa]."""
        return self.rho0 * self.g * self.height

    @property
    def sound(self):
        """Return the speed of compression waves [m/s]."""
        return sqrt(stiffness(self.law) / self.rho0)


class Settled(NamedTuple):
    """A column at rest, by particle."""

    X: np.ndarray       # height in the column at rest shape, |X| [m]
    x: np.ndarray       # height, |x| [m]
    stress: np.ndarray  # P_xx [Pa]


class Series(NamedTuple):
    """A refinement study, and the order that is expected of it."""

    scheme: tuple
    column: str         # soft or stiff
    wall: bool
    expected: tuple | None      # band of the order; None: recorded only
    why: str = ""


SOFT = Column(FixedCorotated(*lame(1e6, 0.0)), height=50.0, rho0=80.0)
STIFF = Column(FixedCorotated(*lame(1e8, 0.0)), height=50.0, rho0=80.0)
WATER = Column(Fluid(lam=1000.0 * 100.0 * 2.0 * 10.0 * 2.0), height=2.0, rho0=1000.0)
WATER_SCHEME = ("mls", 3, 2)

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


def settled(column, scheme, cells, wall):
    """Return the `Settled` column with `cells` cells over H, or None if the run was lost.

    scheme is (transfer, degree, particles per cell and direction).
    """
    dx = column.height / cells
    matter, X = strip(0.0 if wall else -column.height, column.height, dx, column.rho0, column.law,
                      scheme)
    weight = np.zeros((len(X), 2))
    weight[:, 0] = -column.g * np.sign(X)
    lowest = 0.5 * pi * column.sound / column.height
    try:
        settle(matter, strip_stepper(dx, scheme, ON_WALL if wall else None), weight,
               Pace(lowest, CFL * dx / column.sound))
    except OutOfRange:
        return None
    q = matter.particles
    stretch, tau = (q.F, q.tau) if q.F.ndim == 1 else (q.F[:, 0, 0], q.tau[:, 0, 0])
    return Settled(np.abs(X), np.abs(q.x[:, 0]), tau / stretch)


def stress_errors(column, state):
    """Return the mean and largest error of P_xx over the pressure at the floor; 1 if lost."""
    if state is None:
        return 1.0, 1.0
    exact = -column.rho0 * column.g * (column.height - state.X)
    error = np.minimum(np.abs(state.stress - exact) / column.pressure, 1.0)
    return float(np.mean(error)), float(np.max(error))


def place_error(column, state):
    """Return the largest error of a particle's height over the sinking of the surface."""
    k = column.rho0 * column.g / column.law.lam
    exact = state.X - k * (column.height * state.X - 0.5 * state.X**2)
    return float(np.max(np.abs(state.x - exact))) / (0.5 * k * column.height**2)


@experiment("verification.compaction", title="Elastic column under its weight",
            profiles=("quick", "standard"), budget={"quick": 10, "standard": 30})
def compaction(run):
    """Record orders of the stress with and without a wall; linear splines as negative control."""
    cells = run.choose(quick=(8, 16, 32), standard=(8, 16, 32, 64))
    rows = []
    for series in run.progress(run.choose(quick=QUICK, standard=STANDARD), "series"):
        states, errors = refine(series.scheme, series.column, series.wall, cells)
        if series.column == "soft" and series.scheme == QUICK[0].scheme:
            record_profile(run, series, states[0])
        rows += [(*series.scheme, series.column, series.wall, n, *e)
                 for n, e in zip(cells, errors, strict=True)]
        record_series(run, series, cells, errors)
    run.table("errors", ("transfer", "degree", "per_direction", "column", "wall", "cells",
                         "mean_error", "largest_error"), rows)
    record_linear_splines(run, cells)


def refine(scheme, column, wall, cells):
    """Return states for numbers of cells over the height, and their mean and largest errors."""
    problem = SOFT if column == "soft" else STIFF
    states = [settled(problem, scheme, n, wall) for n in cells]
    return states, [stress_errors(problem, state) for state in states]


def floor(wall):
    """Return the name of a kind of floor in targets and tables."""
    return "wall" if wall else "symmetric"


def record_profile(run, series, state):
    """Write the stress of the coarsest column over its height, both over the exact ones."""
    ranks = np.argsort(state.X, kind="stable")
    run.table(f"profile-{floor(series.wall)}", ("X", "stress"),
              list(zip(state.X[ranks] / SOFT.height, state.stress[ranks] / SOFT.pressure,
                       strict=True)))


def record_series(run, series, cells, errors):
    """Record the order of a series."""
    rule = {"comparator": "band", "bound": series.expected} if series.expected else {
        "comparator": "info"}
    id = f"verification.compaction.{series.column}.{floor(series.wall)}.{name(series.scheme)}"
    run.record(f"{id}.order", order([1.0 / n for n in cells], [mean for mean, _ in errors]),
               **rule, note=series.why,
               scale=f"{cells} cells over the height; mean error {errors[0][0]:.1e} to "
                     f"{errors[-1][0]:.1e}, largest {errors[-1][1]:.1e} at the finest")


def record_linear_splines(run, cells):
    """Record the growth of the error with linear splines: the negative control."""
    (coarse, _), (fine, _) = refine(("flip", 1, 2), "soft", False, (cells[0], cells[-1]))[1]
    run.record("verification.compaction.soft.symmetric.flip-linear-2.growth", fine / coarse,
               comparator=">=", bound=1.0, scale=f"{cells[0]} and {cells[-1]} cells",
               note="negative control: the error of linear splines does not fall, because "
                    "particles cross cells; the ratio of the errors, which are cut at 100 %")


@experiment("verification.hydrostatic", title="Column of weakly compressible water",
            profiles=("quick", "standard"), budget={"quick": 5, "standard": 15})
def hydrostatic(run):
    """Record orders of pressure and places of the particles, with and without a wall."""
    cells = run.choose(quick=(8, 16, 32), standard=(8, 16, 32, 64, 128))
    rows = []
    for wall in (False, True):
        states = [settled(WATER, WATER_SCHEME, n, wall)
                  for n in run.progress(cells, f"wall: {wall}")]
        errors = [(stress_errors(WATER, s)[0], place_error(WATER, s)) for s in states]
        rows += [(wall, n, *e) for n, e in zip(cells, errors, strict=True)]
        record_water(run, wall, cells, errors)
    run.table("errors", ("wall", "cells", "pressure_error", "place_error"), rows)


def record_water(run, wall, cells, errors):
    """Record the orders of pressure and place."""
    sizes = [1.0 / n for n in cells]
    scale = f"{cells} cells over the height, {name(WATER_SCHEME)}"
    for k, quantity in enumerate(("pressure", "place")):
        p, last = order(sizes, [e[k] for e in errors]), errors[-1][k]
        run.record(f"verification.hydrostatic.{floor(wall)}.{quantity}.order", p,
                   paper=1.0 if wall else 2.0,
                   comparator="band", bound=(0.8, 1.3) if wall else (1.8, 2.3),
                   scale=f"{scale}; last error {last:.1e}",
                   note="the wall's first order, as in verification.compaction" if wall else "")
