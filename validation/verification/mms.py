"""Order of accuracy against the axis-aligned manufactured solution.

The unit square is elastic (E = 1e7 Pa, nu = 0.3, rho0 = 1000 kg/m^3) and moves with A = 0.05 m for
one oscillation. Space repeats by a periodic grid, which is exact. The error is the RMS over the
particles of the distance to where they should be, the largest over time, divided by A.
"""

from math import sqrt
from typing import NamedTuple

import numpy as np

from mpm_ref.explicit import Scheme, Stepper
from mpm_ref.materials import LogNeoHookean, lame, stiffness

from ..common.registry import experiment
from .axis_aligned import AxisAligned, forcing, forcing_by_differences
from .convergence import order
from .lattice import Periodic, body, fitted, lattice
from .manufactured import follow, step_count

E, NU, RHO0, A = 1e7, 0.3, 1000.0, 0.05
LAW = LogNeoHookean(*lame(E, NU))
C = sqrt(E / RHO0)                              # of the motion [m/s]
SOUND = sqrt(stiffness(LAW) / RHO0)             # speed of compression waves at rest [m/s]
CFL = 0.4           # of SOUND; half or twice of it changes errors at 64 cells by less than 10 %
CELLS = (16, 32, 64)

# What must be of second order, and what must not [Steffen2008]: (transfer, degree, per direction).
SECOND_ORDER = (("mls", 3, 2), ("mls", 2, 3))
# and what the same splines promise with other transfers, whose smoothing or noise may hide it
OTHERS = tuple((transfer, degree, per) for transfer in ("apic", "flip")
               for _, degree, per in SECOND_ORDER)
CONTROL = ("flip", 1, 2)
GIMP = ("flip", 2, 2)       # averages the linear splines of the control over the same particles
ALL = tuple((transfer, degree, per)
            for transfer, degrees in (("pic", (1, 2, 3)), ("flip", (1, 2, 3)),
                                      ("apic", (2, 3)), ("mls", (2, 3)))
            for degree in degrees for per in (1, 2, 3, 4))
COLUMNS = ("dim", "transfer", "degree", "per_direction", "cells", "dx", "dt", "cfl", "steps",
           "particles", "error")
DEGREES = {1: "linear", 2: "quadratic", 3: "cubic"}


class MmsRun(NamedTuple):
    """The settings of one run."""

    transfer: str
    degree: int
    per: int            # particles per cell and direction
    cells: int          # per side
    dim: int = 2
    cfl: float = CFL
    crossings: float = 0.0      # relaxation of the transfer, in times dx/SOUND
    rpic: float = 0.0           # damping of the strain rate in C
    gimp: float = 0.0           # particles per cell and axis of GIMP
    precision: str = "double"

    @property
    def dt(self):
        """Return the largest time step [s]."""
        return self.cfl / (self.cells * SOUND)

    @property
    def scheme(self):
        """Return the `explicit.Scheme` of the run."""
        relaxation = self.crossings / (self.cells * SOUND)
        return Scheme(self.degree, self.transfer, rpic=self.rpic, relaxation=relaxation,
                      gimp=self.gimp, precision=self.precision)

    @property
    def steps(self):
        """Return the number of steps."""
        return step_count(2.0 / C, self.dt)


def error(case):
    """Return the error of an `MmsRun`, relative to A."""
    d, spacing = case.dim, 1.0 / (case.cells * case.per)
    X = lattice([0.0] * d, [1.0] * d, spacing)
    square = fitted(body(X, spacing, RHO0, LAW, case.transfer), case.scheme)
    stepper = Stepper(case.scheme, 1.0 / case.cells, d, np.zeros(d), Periodic([case.cells] * d))
    return follow(square, AxisAligned(X, LAW, RHO0, A, C), stepper, 2.0 / C, case.dt) / A


def sweep(family, cells, dim=2, gimp=0.0):
    """Return the order of a family over numbers of cells, and the rows of the table.

    family is (transfer, degree, particles per direction); gimp is that of `MmsRun`.
    """
    cases = [MmsRun(*family, n, dim, gimp=gimp) for n in cells]
    errors = [error(case) for case in cases]
    rows = [(dim, *family, case.cells, 1.0 / case.cells, 2.0 / C / case.steps, CFL, case.steps,
             (case.cells * case.per) ** dim, e) for case, e in zip(cases, errors, strict=True)]
    return order([1.0 / n for n in cells], errors), rows


def name(family):
    """Return the name of a family in targets, such as mls-cubic-2."""
    transfer, degree, per = family
    return f"{transfer}-{DEGREES[degree]}-{per}"


@experiment("verification.mms", title="Axis-aligned manufactured solution: order of accuracy",
            profiles=("quick", "standard"), budget={"quick": 10, "standard": 240})
def mms(run):
    """Record the orders of all families, and the forcing against one without derivation."""
    record_forcing(run)
    families = run.choose(quick=(*SECOND_ORDER, CONTROL), standard=ALL)
    rows, orders = [], {}
    for family in run.progress(families, "families"):
        orders[family], more = sweep(family, CELLS)
        rows += more
    run.table("errors", COLUMNS, rows)
    run.table("orders", ("transfer", "degree", "per_direction", "order"),
              [(*family, p) for family, p in orders.items()])
    record_orders(run, orders)
    record_gimp(run, [row for row in rows if row[1:4] == CONTROL])
    if run.profile == "standard":
        record_3d(run)


def record_forcing(run):
    """Record the largest relative error of the body force over random points, in 2D and 3D."""
    worst = 0.0
    for d in (2, 3):
        for X, t in ((run.rng.random(d), run.rng.random() * 2.0 / C) for _ in range(4)):
            b = forcing_by_differences(LAW, RHO0, (A, C), X, t)
            ours = forcing(d)(LAW.mu, LAW.lam, RHO0, A, C, t, *X)
            worst = max(worst, float(np.max(abs(ours - b)) / np.max(np.abs(b))))
    run.record("verification.mms.forcing", worst, comparator="<=", bound=1e-10,
               scale="4 random points each in 2D and 3D",
               note="symbolic body force against differences of motion and energy in 80 digits")


def record_orders(run, orders):
    """Record the orders that the theory of B-spline MPM promises, and those it denies."""
    scale = f"{CELLS} cells per side, {CFL} of the CFL limit, one oscillation"
    for family in (one for one in (*SECOND_ORDER, *OTHERS) if one in orders):
        run.record(f"verification.mms.order.{name(family)}", orders[family], paper=2.0,
                   comparator="band", bound=(1.8, 2.3), scale=scale)
    for family in orders:
        if family not in (*SECOND_ORDER, *OTHERS, CONTROL):
            run.record(f"verification.mms.order.{name(family)}", orders[family], comparator="info",
                       scale=scale, note="no order is promised: few particles, the transfer's own "
                       "smoothing, or kinks of linear splines set it")
    run.record(f"verification.mms.order.{name(CONTROL)}", orders[CONTROL], comparator="<=",
               bound=1.0, scale=scale,
               note="negative control: linear splines must not converge, because their gradient "
                    "jumps where particles cross cells")


def record_gimp(run, linear):
    """Record how many times smaller the error of GIMP is than that of the control, whose rows of
    the table are `linear`; beside it the quadratic splines, for which a particle fills a cell.
    """
    rows = []
    for gimp in (1.0, float(GIMP[2])):
        p, more = sweep(GIMP, CELLS, gimp=gimp)
        rows += [(gimp, *row) for row in more]
    run.table("errors-gimp", ("gimp", *COLUMNS), rows)
    run.record("verification.mms.gimp.gain", linear[-1][-1] / rows[-1][-1], comparator=">=",
               bound=12.0, scale=f"{CELLS[-1]} cells per side, {CFL} of the CFL limit",
               note="error of linear splines over that of GIMP on the finest grid; half of what "
                    "first order against none makes of 6, the ratio on the coarsest")
    run.record("verification.mms.gimp.order", p, comparator="info",
               scale=f"{CELLS} cells per side, {CFL} of the CFL limit, one oscillation",
               note="no order is promised, as for quadratic splines with as few particles: those "
                    "of unchanged length leave gaps and overlaps where strain varies")


def record_3d(run):
    """Record one family in 3D; 8 cells would be too few for an order, as they are in 2D."""
    family, cells = SECOND_ORDER[0], (16, 24, 32)
    p, rows = sweep(family, cells, dim=3)
    run.table("errors-3d", COLUMNS, rows)
    run.record(f"verification.mms.order-3d.{name(family)}", p, paper=2.0, comparator="band",
               bound=(1.8, 2.3), scale=f"{cells} cells per side, {CFL} of the CFL limit")
