"""Small elastic blocks, and runs of them."""

import numpy as np

from mpm_ref.body import Body
from mpm_ref.core.state import NONE
from mpm_ref.explicit import Scheme, Stepper
from mpm_ref.materials import make_law
from mpm_ref.problem import Clock, Problem
from mpm_ref.timestep import stable_dt

from ..verification.lattice import body, lattice

RHO, E, NU = 1000.0, 1e6, 0.3
JELLY = make_law("fixed_corotated", E=E, nu=NU)
STILL = np.zeros(2)


def block(X, spacing, law=JELLY, rho=RHO, transfer="mls"):
    """Body at rest with particles at X (N, d) that own spacing^d each [m^d]."""
    made = body(X, spacing, rho, law, transfer)
    return made._replace(particles=made.particles._replace(b=NONE))


def square(cells, dx, law=JELLY, rho=RHO, transfer="mls"):
    """Square of so many cells per side from the origin, 2 x 2 particles in each."""
    spacing = 0.5 * dx
    return block(lattice([0.0, 0.0], [cells * dx] * 2, spacing), spacing, law, rho, transfer)


def alone(x, dx, law=JELLY, transfer="mls"):
    """One particle at x (d,), a quarter of a cell large."""
    return block(np.array([x], dtype=float), 0.5 * dx, law, RHO, transfer)


def shaken(made, strain=0.02, speed=0.5):
    """The body stretched by `strain` along x and half of it less along y, in uneven motion."""
    q = made.particles
    q.F[:] = np.diag([1.0 + strain, 1.0 / (1.0 + 0.5 * strain)])
    q.v[:, 0], q.v[:, 1] = speed * np.sin(3.0 * q.x[:, 1]), speed * np.cos(5.0 * q.x[:, 0])
    return made


def problem(bodies, dx, clock, scheme=None, **rules):
    """A `Problem` without gravity unless `rules` say otherwise."""
    bodies = (bodies,) if isinstance(bodies, Body) else bodies
    rules = {"gravity": np.zeros(bodies[0].particles.x.shape[1]), **rules}
    return Problem(bodies, dx, clock, scheme=scheme or Scheme(), **rules)


def bounds(bodies, dx, scheme=None):
    """The `TimeStep` of bodies as they stand."""
    bodies = (bodies,) if isinstance(bodies, Body) else bodies
    stepper = Stepper(scheme or Scheme(), dx, bodies[0].particles.x.shape[1], STILL)
    stepper.start(bodies)
    return stable_dt(bodies, stepper)


def steps(n, dt):
    """A clock of n fixed steps."""
    return Clock(dt=dt, steps=n)
