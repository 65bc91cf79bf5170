"""Small elastic blocks for the extremes of explicit and implicit steps, and problems that hold
them.
"""

import numpy as np

from mpm_ref.body import Body
from mpm_ref.core.state import NONE
from mpm_ref.explicit import Scheme, Stepper
from mpm_ref.materials import make_law
from mpm_ref.problem import Clock, Problem
from mpm_ref.timestep import stable_dt

from ..verification.lattice import body as body_at
from ..verification.lattice import lattice

RHO, E, NU = 1000.0, 1e6, 0.3
DX = 0.125                          # [m] a power of two: shifts by whole cells round nothing
FRAME = 1.0 / 24.0                  # [s] the longest step of HOT's paper
JELLY = make_law("fixed_corotated", E=E, nu=NU)
NO_GRAVITY = np.zeros(2)


def elastic(E, nu=NU):
    """Return a fixed corotated law."""
    return make_law("fixed_corotated", E=E, nu=nu)


def gravity(d):
    """Return the earth's gravity, along the second axis [m/s^2]."""
    return (0.0, -9.8, 0.0)[:d]


def block(X, spacing, law=JELLY, rho=RHO, transfer="mls"):
    """Return a body at rest with particles at X (N, d) of volume spacing^d each [m^d]."""
    body = body_at(X, spacing, rho, law, transfer)
    return body._replace(particles=body.particles._replace(b=NONE))


def square(cells, dx, law=JELLY, rho=RHO, transfer="mls"):
    """Return a square of `cells` cells per side from the origin, with 2 x 2 particles in each."""
    spacing = 0.5 * dx
    return block(lattice([0.0, 0.0], [cells * dx] * 2, spacing), spacing, law, rho, transfer)


def brick(cells, law=None, per=2, dx=DX):
    """Return a box from the origin of `cells` along each axis, with per^d particles in each."""
    h = dx / per
    X = lattice([0.0] * len(cells), [n * dx for n in cells], h)
    return block(X, h, law or elastic(E), transfer="apic")


def one_particle(x, dx, law=JELLY, transfer="mls"):
    """Return a body of one particle at x (d,), of the size of a quarter of a cell."""
    return block(np.array([x], dtype=float), 0.5 * dx, law, RHO, transfer)


def halves(cells, laws):
    """Return two bodies: the halves, along the first axis, of a box, each with its law."""
    box, middle = brick(cells, laws[0]), 0.5 * cells[0] * DX
    left = box.particles.x[:, 0] < middle
    return tuple(select_particles(box, mask)._replace(name=name, law=law) for name, mask, law in
                 (("left", left, laws[0]), ("right", ~left, laws[1])))


def select_particles(body, mask):
    """Return a body with the particles of a mask (N,)."""
    q = body.particles
    arrays = (a[mask] if len(a) == len(mask) else a for a in q)
    return body._replace(particles=type(q)(*arrays), id=np.arange(int(mask.sum())))


def shake(body, strain=0.02, speed=0.5):
    """Stretch a body by `strain` along the first axis, compress it by about half of it along the
    others, and give it an uneven velocity, in place. Returns the body.
    """
    q = body.particles
    d = q.x.shape[1]
    q.F[:] = np.diag([1.0 + strain] + [1.0 / (1.0 + 0.5 * strain)] * (d - 1))
    q.v[:, 0], q.v[:, 1] = speed * np.sin(3.0 * q.x[:, 1]), speed * np.cos(5.0 * q.x[:, 0])
    return body


def problem(bodies, dx, clock, scheme=None, **rules):
    """Return a `Problem` without gravity unless `rules` set it."""
    bodies = (bodies,) if isinstance(bodies, Body) else bodies
    rules = {"gravity": np.zeros(bodies[0].particles.x.shape[1]), **rules}
    return Problem(bodies, dx, clock, scheme=scheme or Scheme(), **rules)


def step_limits(bodies, dx, scheme=None):
    """Return the `TimeStep` of bodies in their present state."""
    bodies = (bodies,) if isinstance(bodies, Body) else bodies
    stepper = Stepper(scheme or Scheme(), dx, bodies[0].particles.x.shape[1], NO_GRAVITY)
    stepper.start(bodies)
    return stable_dt(bodies, stepper)


def fixed_clock(count, dt):
    """Return a clock of `count` steps of fixed length."""
    return Clock(dt=dt, steps=count)


def message_of(call):
    """Return the sentence of the ValueError that a call raises, "" if it raises none."""
    try:
        call()
    except ValueError as error:
        return " ".join(str(error).split())
    return ""
