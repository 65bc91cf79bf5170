"""Energies and momenta of bodies, summed in a fixed order: the same bits for any number of
threads.
"""

from typing import NamedTuple

import numpy as np

from .core.deform import recall
from .core.jit import CHUNKS, chunk, kernel, parallel_if_many, prange, total
from .core.law import intact, psi, psi_volume
from .core.tensor import mat


class Energy(NamedTuple):
    """Mechanical energy of bodies [J]; in 2D of a slice 1 m thick."""

    kinetic: float      # sum_p m_p |v_p|^2 / 2, and of the affine motion where C is carried
    elastic: float      # sum_p V0_p psi(F_p)
    gravity: float      # -sum_p m_p g . x_p

    @property
    def sum(self):
        """Kinetic + elastic + gravity."""
        return self.kinetic + self.elastic + self.gravity


@kernel
def _psi(particles, law, flow, out, like, bounds):
    for p in range(bounds[0], bounds[1]):
        whole = intact(recall(particles.y, p), flow)
        out[p] = particles.V0[p] * whole * psi(mat(particles.F, p, like), law)


@kernel
def _psi_fluid(particles, law, out, bounds):
    for p in range(bounds[0], bounds[1]):
        out[p] = particles.V0[p] * psi_volume(particles.F[p], law)


@parallel_if_many
def _psi_all(particles, law, flow, out, like):
    for c in prange(CHUNKS):
        _psi(particles, law, flow, out, like, chunk(c, len(out)))


@parallel_if_many
def _psi_fluid_all(particles, law, out):
    for c in prange(CHUNKS):
        _psi_fluid(particles, law, out, chunk(c, len(out)))


def elastic(body):
    """Return the elastic energy of every particle of a body (N,) [J]; NaN or inf where the law
    refuses F, NaN of a law without energy.
    """
    out = np.full(len(body.particles.x), np.nan)
    if type(body.law) not in psi.methods:
        return out
    if body.particles.F.ndim == 1:
        _psi_fluid_all(body.particles, body.law, out)
    else:
        like = tuple(range(body.particles.x.shape[1]))
        _psi_all(body.particles, body.law, body.flow, out, like)
    return out


def kinetic(particles, inertia=0.0):
    """Return the kinetic energy of every particle (N,) [J]; inertia D = dx^2 (degree + 1)/12 [m^2]
    adds the affine motion, m D |C|^2 / 2.
    """
    e = 0.5 * particles.m * np.einsum("pa,pa->p", particles.v, particles.v)
    if inertia and particles.C.ndim == 3:
        e += 0.5 * inertia * particles.m * np.einsum("pab,pab->p", particles.C, particles.C)
    return e


def energy(bodies, gravity, inertia=0.0):
    """Return the `Energy` of all bodies under the acceleration gravity (d,)."""
    parts = np.zeros(3)
    for body in bodies:
        q = body.particles
        parts += (
            total(kinetic(q, inertia)),
            total(elastic(body)),
            -sum(g * total(q.m * q.x[:, a]) for a, g in enumerate(gravity)),
        )
    return Energy(*map(float, parts))


def momentum(bodies):
    """Return the linear momentum sum_p m_p v_p (d,) [kg m/s]."""
    d = bodies[0].particles.x.shape[1]
    sums = [[total(b.particles.m * b.particles.v[:, a]) for a in range(d)] for b in bodies]
    return np.sum(sums, axis=0)


def angular_momentum(bodies, inertia=0.0, about=None):
    """Return the angular momentum about a point: sum_p m_p (x_p x v_p) plus, where C is carried,
    the particles' own spin sum_p m_p D eps : C_p^T [APIC]. A scalar (1,) in 2D, a vector (3,) in 3D
    [kg m^2/s].
    """
    d = bodies[0].particles.x.shape[1]
    pairs = [(0, 1)] if d == 2 else [(1, 2), (2, 0), (0, 1)]
    out = np.zeros(len(pairs))
    for body in bodies:
        q = body.particles
        r = q.x - (np.zeros(d) if about is None else np.asarray(about, dtype=float))
        for k, (a, b) in enumerate(pairs):
            out[k] += total(q.m * (r[:, a] * q.v[:, b] - r[:, b] * q.v[:, a]))
            if inertia and q.C.ndim == 3:
                out[k] += inertia * total(q.m * (q.C[:, b, a] - q.C[:, a, b]))
    return out
