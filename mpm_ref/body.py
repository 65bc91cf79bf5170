"""A body: particles of one material, in arrays of their own."""

from typing import NamedTuple

import numpy as np

from .core.state import NO_HISTORY, NONE, Particles

AFFINE = ("apic", "mls")      # transfers that carry C


class Body(NamedTuple):
    """Particles that share a law and a return map. Kernels change the arrays in place."""

    name: str
    particles: Particles
    law: tuple            # NamedTuple of the elastic law's parameters (see materials)
    flow: tuple           # NamedTuple of the return map's parameters
    id: np.ndarray        # (N,) number of each particle in the order in which the body was sampled


def particles_at(x, v, m, V0, transfer="mls", fluid=False):
    """Particles without stress (F = I) at x (N, d) with velocity v (N, d), mass m (N,), volume V0
    (N,); all are copied. Only the fields that the transfer needs are allocated; `fluid` carries J
    instead of F. Further fields are set by `_replace`: the history y (N,), a body force b (N, d).
    """
    n, d = x.shape
    L = np.zeros((n, d, d))
    C = NONE
    if transfer in AFFINE:
        C = L if transfer == "mls" else np.zeros((n, d, d))
    return Particles(
        *(np.array(a, dtype=float, order="C") for a in (x, v)),
        C=C,
        L=L,
        F=np.ones(n) if fluid else np.tile(np.eye(d), (n, 1, 1)),
        tau=np.zeros(n) if fluid else np.zeros((n, d, d)),
        m=np.array(m, dtype=float),
        V0=np.array(V0, dtype=float),
        y=NO_HISTORY,
        b=NONE,
    )


def permute(body, order):
    """Put the particles of a body into the given order, in place."""
    for name, a in zip(Particles._fields, body.particles, strict=True):
        carried = len(a) == len(order)
        if carried and not (name == "L" and a is body.particles.C):
            a[:] = a[order]
    body.id[:] = body.id[order]


def keep_inside(bodies, low, high):
    """Clip positions to a box, velocities unchanged (NCLaw)."""
    for body in bodies:
        np.clip(body.particles.x, low, high, out=body.particles.x)
