"""A small block that hits a floor, held on one side: the pose of an implicit step, in 2D and 3D."""

from itertools import product

import numpy as np

from mpm_ref.body import Body, particles_at
from mpm_ref.core.boundary import BoxWalls, Collider, Conditions, Prescribed
from mpm_ref.core.levelset import half_space
from mpm_ref.explicit import Scheme
from mpm_ref.hot.step import ImplicitStepper
from mpm_ref.materials import NoFlow, make_law

DX, RHO = 0.1, 1000.0
DT = 0.01


def unit(d, axis):
    return tuple(np.eye(d)[axis])


def block(d, E, low, side):
    """A strained block of 2^d particles per cell, with `side` of them along an edge."""
    x = (np.array(list(product(range(side), repeat=d))) + 0.5) * DX / 2 + low
    V0 = np.full(len(x), (DX / 2) ** d)
    r = x - x.mean(axis=0)
    v = r @ np.linspace(-2.0, 2.5, d * d).reshape(d, d) - 0.5
    q = particles_at(x, v, RHO * V0, V0, "apic")
    q.F[:] = np.eye(d) + 0.1 * np.random.default_rng(0).uniform(-1.0, 1.0, q.F.shape)
    law = make_law("fixed_corotated", E=E, nu=0.3)
    return Body(f"block {low[0]}", q, law, NoFlow(), np.arange(len(x)))


def conditions(d):
    """A floor that nodes slip along, askew, and a side that is held."""
    normal = np.array(unit(d, d - 1)) + 0.2 * np.array(unit(d, 0))
    floor = Collider(half_space((0.0,) * d, tuple(normal)), "slip")
    side = Prescribed(half_space((0.15,) * d, unit(d, 0)))     # between nodes of level 1
    return Conditions((floor,), (side,))


def stepper_of(d, side=None, options=None):
    """(stepper, bodies): two blocks side by side, the second ten times stiffer."""
    side = side or {2: 10, 3: 5}[d]
    shift = side * DX / 2 * np.array(unit(d, 0))
    bodies = block(d, 1e5, np.zeros(d), side), block(d, 1e6, shift, side)
    g = -9.8 * np.array(unit(d, d - 1))
    stepper = ImplicitStepper(Scheme(transfer="apic"), DX, d, g, conditions(d), options)
    stepper.start(bodies)
    return stepper, bodies


def pose_of(d, side=None):
    """The pose of the first step."""
    stepper, bodies = stepper_of(d, side)
    return stepper.problem(bodies, 0.0, DT)


def walls(d, low, high):
    """Sticky walls at nodes below `low` or above `high` on the last axis."""
    none = (None,) * (d - 1)
    return BoxWalls((*none, low), (*none, high), "sticky")
