"""Bodies in NCLaw's box: in the middle of it, in corners, with random states; and a
small cube.
"""

import numpy as np

from mpm_ref.body import Body, particles_at
from mpm_ref.core.boundary import Conditions, nclaw_walls
from mpm_ref.explicit import Scheme
from mpm_ref.materials import FixedCorotated, NoFlow
from mpm_ref.nclaw.batched_step import States, make_world
from mpm_ref.problem import Clock, Problem

DX, DT = 0.05, 5e-4
V0, DENSITY = 1.25e-4, 1000.0
LOWER, UPPER = 0.145, 0.855     # [m] a clip that is reached, unlike NCLaw's
LAW = FixedCorotated(4e4, 3e4)
FIELDS = States._fields
CARRIED = FIELDS[:4]            # from step to step
SPEED = 20.0                    # [m/s] towards a corner: in a step 0.2 cells
CELLS = {"low": (2, 4), "middle": (8, 10), "high": (14, 16)}    # of bodies, along each axis
TOWARDS = {"low": -SPEED, "middle": 0.0, "high": SPEED}


def body_at(place, n, rng):
    """A random state (x, v, C, F, tau) of n particles, none within 0.1 cells of where its stencil
    changes; those in corners fly into the walls, some past the clip.
    """
    first, last = CELLS[place]
    cell = rng.integers(first, last + 1, (n, 3))
    x = DX * (cell + 0.5 + rng.uniform(0.42, 0.58, (n, 3)))
    return (x, TOWARDS[place] + rng.normal(size=(n, 3)), 5.0 * rng.normal(size=(n, 3, 3)),
            np.eye(3) + 0.2 * rng.normal(size=(n, 3, 3)), 1e3 * rng.normal(size=(n, 3, 3)))


def states(places, n, seed=0):
    """`States` of bodies."""
    rng = np.random.default_rng(seed)
    return States(*map(np.stack, zip(*(body_at(place, n, rng) for place in places))))


def problem_of(states, b, clip=(LOWER, UPPER)):
    """A `Problem` with the settings of NCLAW-sim and body b of some states, its stress set."""
    x, v, C, F, tau = (a[b].copy() for a in states)
    n = len(x)
    q = particles_at(x, v, np.full(n, DENSITY * V0), np.full(n, V0), "mls")
    for name, a in (("C", C), ("F", F), ("tau", tau)):
        getattr(q, name)[:] = a
    return in_box(q, Clock(dt=DT, steps=1), clip)


def in_box(q, clock, clip):
    """`Problem` of a body of particles in the box of NCLAW-sim."""
    body = Body("one", q, LAW, NoFlow(), np.arange(len(q.x)))
    return Problem((body,), DX, clock, np.array((0.0, -9.8, 0.0)),
                   Scheme(mass_eps=1e-7, gravity_on_empty=True),
                   Conditions(walls=nclaw_walls(20, 3)), tuple(np.full(3, a) for a in clip))


def cube(steps, seed=0):
    """`Problem` of a cube of 3 x 3 x 3 particles, as far apart as NCLaw's, strained at random and
    flying with a random velocity gradient.
    """
    rng, spacing = np.random.default_rng(seed), 0.5 / 9
    r = spacing * (np.indices((3, 3, 3)).reshape(3, -1).T - 1.0)
    v = np.array((1.0, -1.5, -2.0)) + r @ (8.0 * rng.normal(size=(3, 3)))
    q = particles_at(0.5 + r, v, np.full(27, DENSITY * V0), np.full(27, V0), "mls")
    q.F[:] += 0.1 * rng.normal(size=q.F.shape)
    return in_box(q, Clock(dt=DT, steps=steps, every=1), (0.025, 0.975))


def world_of(states, clip=(LOWER, UPPER)):
    """Their `World`."""
    return make_world(problem_of(states, 0, clip))


def random_like(states, rng, sizes=None):
    """Random numbers in the shape of `States`, fields times their sizes."""
    return States(*(rng.normal(size=a.shape) * (sizes or {}).get(name, 1.0)
                    for name, a in zip(FIELDS, states)))
