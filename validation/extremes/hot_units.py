"""The same problem in other units must give the same iterates."""

from typing import NamedTuple

import numpy as np

from mpm_ref.core.state import Particles

from ..common.registry import experiment
from .hot_bodies import elastic
from .hot_solve import METHODS, copied, stepper_of
from .hot_stiffness import bent


class Units(NamedTuple):
    """How many units of length, time and mass make one of SI."""

    L: float
    T: float
    M: float


SYSTEMS = {"binary": Units(2.0**5, 2.0**-3, 2.0**-40), "cgs": Units(1e2, 1.0, 1e3)}
TRIALS = 3                      # of changes in the last digit
FREE = ("hot", "hot-plus", "lbfgs-h")       # of constants that carry units


def converted(setup, units):
    """The setup with all its numbers in other units."""
    L, T, M = units
    d = len(setup.gravity)
    factors = Particles(x=L, v=L / T, C=1.0 / T, L=1.0 / T, F=1.0, tau=M * L ** (2 - d) / T**2,
                        m=M, V0=L**d, y=1.0, b=1.0)
    bodies = copied(setup.bodies)
    for body in bodies:
        for a, factor in zip(body.particles, factors, strict=True):
            a *= factor
    bodies = tuple(b._replace(law=type(b.law)(*(factors.tau * p for p in b.law))) for b in bodies)
    gravity = tuple(g * L / T**2 for g in setup.gravity)
    return setup._replace(bodies=bodies, dx=setup.dx * L, dt=setup.dt * T, gravity=gravity)


def solved(setup, method):
    """(`Report`, increment (n, d)) of one step."""
    setup = setup._replace(bodies=copied(setup.bodies))
    stepper = stepper_of(setup, method)
    dv = stepper.solve(stepper.problem(setup.bodies, 0.0, setup.dt))
    return stepper.report, dv


class Apart(NamedTuple):
    """How a solve in other units differs from the one in SI, relatively."""

    residuals: float        # largest difference; inf if there are more or fewer
    increment: float        # largest difference, over the largest increment
    digit: float            # the same in SI, for changes in the last digit of the velocities
    iterations: int         # in SI
    iterations_there: int
    inner: int              # of CG, in SI
    inner_there: int


def apart(setup, method, units, rng):
    """`Apart` of a method in these units."""
    (r, dv), (r_new, dv_new) = solved(setup, method), solved(converted(setup, units), method)
    a, b = np.array(r.residuals), np.array(r_new.residuals)
    residuals = float(np.max(np.abs(b / a - 1.0))) if len(a) == len(b) else np.inf
    digit = max(far(solved(jittered(setup, rng), method)[1], dv) for _ in range(TRIALS))
    increment = far(dv_new * units.T / units.L, dv)
    return Apart(residuals, increment, digit, r.iterations, r_new.iterations,
                 r.cg_iterations, r_new.cg_iterations)


def far(dv, from_dv):
    """Largest difference over the largest value."""
    return float(np.abs(dv - from_dv).max() / np.abs(from_dv).max())


def jittered(setup, rng):
    """The setup with velocities changed in their last digit."""
    bodies, last = copied(setup.bodies), np.finfo(float).eps
    for body in bodies:
        body.particles.v[:] *= 1.0 + rng.choice([-last, 0.0, last], size=body.particles.v.shape)
    return setup._replace(bodies=bodies)


@experiment("extremes.hot.units", title="The same step in other units",
            profiles=("quick", "standard"), budget={"quick": 1, "standard": 8})
def units(run):
    """Lengths, times and masses rescaled together: residuals have no unit."""
    rows = []
    for d in run.choose(quick=(2,), standard=(2, 3)):
        setup = bent(d, (elastic(1e5), elastic(1e8)))
        for name, system in SYSTEMS.items():
            for method in METHODS:
                rows.append((d, name, method, apart(setup, method, system, run.rng)))
                record_units(run, *rows[-1])
    run.table("differences", ("d", "units", "method", *Apart._fields),
              [(*case, *found) for *case, found in rows])


def record_units(run, d, name, method, found):
    """One method in one system of units."""
    target = f"extremes.hot.units.{d}d.{name}.{method}"
    scale = f"{d}D box of 1e5 and 1e8 Pa, one step of 1/24 s"
    if method not in FREE:
        run.record(target, found.inner_there / found.inner, comparator="info", scale=scale,
                   note=f"CG iterations over those in SI, {found.inner}: their tolerance compares "
                        "the square root of J with kg m/s, as printed (HOT-sec5.3-k), and so "
                        "depends on the units")
    elif name == "binary":
        run.record(target, found.residuals, comparator="<=", bound=0.0, scale=scale,
                   note="largest relative difference of a residual: scaling by powers of two is "
                        "exact, so that a constant with a unit is all that could show")
    else:
        run.record(target, found.increment / found.digit, comparator="<=", bound=10.0, scale=scale,
                   note=f"largest difference of the increment over the largest one, "
                        f"{found.increment:.1e}, over what changes in the last digit of the "
                        f"velocities cause, {found.digit:.1e}: scaling is not exact, and where an "
                        "iteration of a CG comes or goes the solution is another one within eps; "
                        "calibrated: 0.2 to 1")
