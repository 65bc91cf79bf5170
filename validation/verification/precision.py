"""Single against double precision: where rounding exceeds the error of grid and step.

Two motions are run in both precisions:

    mms     the manufactured solution of `mms`: on grids, and with ever shorter steps
    far     a body that flies ever farther from the origin, without forces

A coordinate x is rounded in each step, by at most eps |x|/2. Increments that are equal are rounded
alike, so that this error may grow with the number of steps, up to eps |x| steps/2. (First a random
walk was expected, with the square root of the number; the first run had ten times that.)
"""

import numpy as np

from mpm_ref.explicit import Scheme, Stepper

from ..common.registry import experiment
from .convergence import rms
from .lattice import body, fitted, lattice
from .mms import CFL, LAW, RHO0, SOUND, MmsRun, error

EPS = float(np.finfo(np.float32).eps)
FAMILIES = (("mls", 2, 3), ("mls", 3, 2), ("apic", 2, 3))
STEADY = 1.05           # error in single over that in double, where the grid's error dominates
SHORT = (0.4, 0.1, 0.02)    # of the CFL limit
AWAY = (1.0, 10.0, 100.0, 1000.0)       # distances from the origin [cells]
FLIGHT, DX, SIDE = 200, 0.02, 8     # steps, spacing [m], side of the block [cells]
COLUMNS = ("motion", "transfer", "degree", "cells", "cfl", "distance", "double", "single")


@experiment("verification.precision", title="Single against double precision",
            profiles=("quick", "standard"), budget={"quick": 20, "standard": 240})
def precision(run):
    """Record errors of both precisions, and those of a flight against the bound of rounding."""
    families = run.choose(quick=FAMILIES[:1], standard=FAMILIES)
    cells = run.choose(quick=(16, 32), standard=(16, 32, 64))
    rows = []
    for family in run.progress(families, "transfers"):
        rows += record_grids(run, family, cells)
    rows += record_short_steps(run, FAMILIES[0], cells[0])
    rows += [record_far(run, family, distance) for family in families for distance in AWAY]
    run.table("errors", COLUMNS, rows)


def errors(*settings, **more):
    """Return the errors of an `mms.MmsRun` in double and in single precision."""
    return [error(MmsRun(*settings, **more, precision=one)) for one in ("double", "single")]


def record_grids(run, family, cells):
    """Record the largest ratio of the errors of a family over grids; returns rows."""
    found = {n: errors(*family, n) for n in cells}
    run.record(f"verification.precision.mms.{family[0]}-{family[1]}",
               max(single / double for double, single in found.values()), comparator="<=",
               bound=STEADY, scale=f"{cells} cells per side, {CFL} of the CFL limit",
               note="error of the manufactured solution in single over that in double")
    return [("mms", *family[:2], n, CFL, 0.0, *found[n]) for n in cells]


def record_short_steps(run, family, cells):
    """Record the ratio of the errors for ever shorter steps; returns rows."""
    rows = []
    for cfl in SHORT:
        double, single = errors(*family, cells, cfl=cfl)
        steps = MmsRun(*family, cells, cfl=cfl).steps
        run.record(f"verification.precision.short.{cfl:g}", single / double, comparator="info",
                   scale=f"{cells} cells per side, {steps} steps")
        rows.append(("short", *family[:2], cells, cfl, 0.0, double, single))
    return rows


def record_far(run, family, distance):
    """Record the error of the positions after a flight, over that of steps which all round alike;
    returns a row. distance: of the body from the origin [cells].
    """
    double, single = (flight_error(family, distance, one) for one in ("double", "single"))
    drift = EPS * (distance + SIDE) * DX * FLIGHT / 2.0
    run.record(f"verification.precision.far.{family[0]}-{family[1]}.{distance:g}", single / drift,
               comparator="<=", bound=1.0,
               scale=f"{distance:g} cells from the origin, {FLIGHT} steps",
               note=f"RMS error {single / DX:.2g} dx in single, {double / DX:.2g} dx in double")
    return ("far", *family[:2], SIDE, CFL, distance, double / DX, single / DX)


def flight_error(family, distance, precision):
    """Return the RMS error of the positions [m] of a block of SIDE x SIDE cells after
    `FLIGHT` steps without forces.
    """
    transfer, degree, per = family
    scheme, v = Scheme(degree, transfer, precision=precision), np.array([0.3, 0.2])
    corner = np.array([distance * DX, 0.0])
    X = lattice(corner, corner + SIDE * DX, DX / per)
    block = fitted(body(X, DX / per, RHO0, LAW, transfer), scheme)
    q, dt, stepper = block.particles, CFL * DX / SOUND, Stepper(scheme, DX, 2, np.zeros(2))
    q.v[:] = v
    stepper.start([block])
    for k in range(FLIGHT):
        stepper.step([block], k * dt, dt)
    return rms(q.x - (X + FLIGHT * dt * v))
