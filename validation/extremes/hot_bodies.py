"""Elastic bodies for the extremes of implicit steps, in two or three dimensions."""

import numpy as np

from mpm_ref.materials import make_law

from ..verification.lattice import lattice
from .blocks import NU, E, block

DX = 0.125                          # [m]
FRAME = 1.0 / 24.0                  # [s] the longest step of the paper


def gravity(d):
    """Of the earth, along the second axis [m/s^2]."""
    return (0.0, -9.8, 0.0)[:d]


def elastic(E, nu=NU):
    """Fixed corotated law."""
    return make_law("fixed_corotated", E=E, nu=nu)


def brick(cells, law=None, per=2, dx=DX):
    """A box of so many cells along each axis, from the origin, with per^d particles in each."""
    h = dx / per
    X = lattice([0.0] * len(cells), [n * dx for n in cells], h)
    return block(X, h, law or elastic(E), transfer="apic")


def halves(cells, laws):
    """A box whose two halves along the first axis have these laws."""
    made, middle = brick(cells, laws[0]), 0.5 * cells[0] * DX
    left = made.particles.x[:, 0] < middle
    return tuple(part(made, where)._replace(name=name, law=law) for name, where, law in
                 (("left", left, laws[0]), ("right", ~left, laws[1])))


def part(body, where):
    """The particles of a body that a mask names."""
    q = body.particles
    arrays = (a[where] if len(a) == len(where) else a for a in q)
    return body._replace(particles=type(q)(*arrays), id=np.arange(int(where.sum())))


def shaken(bodies, strain=0.02, speed=0.5):
    """The bodies stretched along the first axis, less compressed along the others, in uneven
    motion.
    """
    for body in bodies:
        q = body.particles
        d = q.x.shape[1]
        q.F[:] = np.diag([1.0 + strain] + [1.0 / (1.0 + 0.5 * strain)] * (d - 1))
        q.v[:, 0], q.v[:, 1] = speed * np.sin(3.0 * q.x[:, 1]), speed * np.cos(5.0 * q.x[:, 0])
    return bodies
