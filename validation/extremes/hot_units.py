"""Invariance of implicit steps: a problem in other units must give the same iterates."""

from typing import NamedTuple

import numpy as np

from mpm_ref.core.state import Particles

from ..common.registry import experiment
from .blocks import elastic
from .hot_parameters import strained_box
from .hot_solve import METHODS, copy_bodies, stepper_of


class UnitSystem(NamedTuple):
    """Units of length, time and mass that make one of SI."""

    L: float
    T: float
    M: float


SYSTEMS = {"binary": UnitSystem(2.0**5, 2.0**-3, 2.0**-40), "cgs": UnitSystem(1e2, 1.0, 1e3)}
TRIALS = 3                      # of changes in the last digit
UNIT_FREE = ("hot", "hot-plus", "lbfgs-h")       # methods without constants that carry units


def convert_units(setup, units):
    """Return the setup with all its numbers in other units."""
    L, T, M = units
    d = len(setup.gravity)
    factors = Particles(x=L, v=L / T, C=1.0 / T, L=1.0 / T, F=1.0, tau=M * L ** (2 - d) / T**2,
                        m=M, V0=L**d, y=1.0, b=1.0)
    bodies = copy_bodies(setup.bodies)
    for body in bodies:
        for a, factor in zip(body.particles, factors, strict=True):
            a *= factor
    bodies = tuple(b._replace(law=type(b.law)(*(factors.tau * p for p in b.law))) for b in bodies)
    gravity = tuple(g * L / T**2 for g in setup.gravity)
    return setup._replace(bodies=bodies, dx=setup.dx * L, dt=setup.dt * T, gravity=gravity)


def solve_step(setup, method):
    """Solve one step. Returns its `Report` and increment (n, d)."""
    setup = setup._replace(bodies=copy_bodies(setup.bodies))
    stepper = stepper_of(setup, method)
    dv = stepper.solve(stepper.problem(setup.bodies, 0.0, setup.dt))
    return stepper.report, dv


class UnitDifference(NamedTuple):
    """Relative differences of a solve in other units from the one in SI."""

    residuals: float        # largest difference; inf if there are more or fewer
    increment: float        # largest difference, over the largest increment
    digit: float            # in SI, by changes in the last digit of the velocities
    iterations: int         # in SI
    iterations_there: int   # in the other units
    inner: int              # of CG, in SI
    inner_there: int


def unit_difference(setup, method, units, rng):
    """Return the `UnitDifference` of a method in other units."""
    r, dv = solve_step(setup, method)
    r_new, dv_new = solve_step(convert_units(setup, units), method)
    a, b = np.array(r.residuals), np.array(r_new.residuals)
    residuals = float(np.max(np.abs(b / a - 1.0))) if len(a) == len(b) else np.inf
    digit = max(relative_difference(solve_step(jittered(setup, rng), method)[1], dv)
                for _ in range(TRIALS))
    increment = relative_difference(dv_new * units.T / units.L, dv)
    return UnitDifference(residuals, increment, digit, r.iterations, r_new.iterations,
                 r.cg_iterations, r_new.cg_iterations)


def relative_difference(dv, from_dv):
    """Return the largest difference over the largest value."""
    return float(np.abs(dv - from_dv).max() / np.abs(from_dv).max())


def jittered(setup, rng):
    """Return the setup with velocities changed in their last digit."""
    bodies, last = copy_bodies(setup.bodies), np.finfo(float).eps
    for body in bodies:
        body.particles.v[:] *= 1.0 + rng.choice([-last, 0.0, last], size=body.particles.v.shape)
    return setup._replace(bodies=bodies)


@experiment("extremes.hot.units", title="The same step in other units",
            profiles=("quick", "standard"), budget={"quick": 1, "standard": 8})
def units(run):
    """Rescale lengths, times and masses together: residuals have no unit."""
    rows = []
    for d in run.choose(quick=(2,), standard=(2, 3)):
        setup = strained_box(d, (elastic(1e5), elastic(1e8)))
        for name, system in SYSTEMS.items():
            for method in METHODS:
                rows.append((d, name, method, unit_difference(setup, method, system, run.rng)))
                record_units(run, *rows[-1])
    run.table("differences", ("d", "units", "method", *UnitDifference._fields),
              [(*case, *difference) for *case, difference in rows])


def record_units(run, d, name, method, difference):
    """Record the difference of one method in one system of units."""
    target = f"extremes.hot.units.{d}d.{name}.{method}"
    scale = f"{d}D box of 1e5 and 1e8 Pa, one step of 1/24 s"
    if method not in UNIT_FREE:
        run.record(target, difference.inner_there / difference.inner, comparator="info",
                   scale=scale, note=f"CG iterations over those in SI, {difference.inner}: their "
                        "tolerance compares the square root of J with kg m/s, as printed "
                        "(HOT-sec5.3-k), and so depends on the units")
    elif name == "binary":
        run.record(target, difference.residuals, comparator="<=", bound=0.0, scale=scale,
                   note="largest relative difference of a residual: scaling by powers of two is "
                        "exact, so that a constant with a unit is all that could show")
    else:
        run.record(target, difference.increment / difference.digit, comparator="<=", bound=10.0,
                   scale=scale, note=f"largest difference of the increment over the largest one, "
                        f"{difference.increment:.1e}, over what changes in the last digit of the "
                        f"velocities cause, {difference.digit:.1e}: scaling is not exact, and "
                        "where an iteration of a CG comes or goes the solution differs within eps; "
                        "calibrated: 0.2 to 1")
