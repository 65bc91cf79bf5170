"""The particles as quadrature points of an implicit step: what stays the same while it is solved.

`QuadraturePoints` holds positions, rest volumes and old deformation gradients; `StressModes` the
differential of the stress at an iterate.

Particles are taken sorted by cell. Cells come first axis slowest, so that slabs (see `core.order`)
are runs of them, and all particles of a cell, which share their nodes, follow each other.
"""

from typing import NamedTuple

import numpy as np

from ..core.jit import CHUNKS, chunk, kernel, parallel, prange
from ..core.law import intact
from ..core.order import by_cell, slab_width, without_last_empty
from ..core.state import NO_HISTORY
from ..core.stencil import locate
from ..core.tensor import diag, mat, put_mat, put_vec, vec
from .return_map import yield_stresses


class QuadraturePoints(NamedTuple):
    """N particles of a body in the order of their cells."""

    base: np.ndarray    # (N, d)        first node that the particle reaches, from the grid's first
    s: np.ndarray       # (N, d)        offset x/dx - base [cells]
    F: np.ndarray       # (N, d, d)     deformation gradient at the start of the step
    V0: np.ndarray      # (N,)          volume at rest [m^d]
    slab: np.ndarray    # (slabs + 1,)  first particle of each slab
    tau_y: np.ndarray   # (N,)          yield stress [Pa], or (0, 0): the potential is elastic
    psi: np.ndarray     # (N,)          workspace: energy [J]
    T: np.ndarray       # (N, d, d)     workspace: a velocity gradient, then a stress


def quadrature_points(body, grid, stencil, return_map="lagged"):
    """`QuadraturePoints` of a body inside the grid, without the particles that have failed; with
    yield stresses if return_map is "implicit".

    A fluid, which carries J alone, gets an F with that determinant: its law depends on no more.
    """
    order = cell_order(body, grid, stencil)
    n, d = len(order), grid.m.ndim
    base, s, F, V0 = np.empty((n, d), np.int64), np.empty((n, d)), np.empty((n, d, d)), np.empty(n)
    _fill_points_all(body.particles, grid, stencil, order, (base, s, F, V0))
    width = slab_width(stencil)
    slabs = np.arange(-(-grid.m.shape[0] // width) + 1)
    start = without_last_empty(np.searchsorted(base[:, 0] // width, slabs))
    tau_y = NO_HISTORY if return_map == "lagged" else yield_stresses(body, order)
    return QuadraturePoints(base, s, F, V0, start, tau_y, np.empty(n), np.empty((n, d, d)))


def cell_order(body, grid, stencil):
    """The particles of `QuadraturePoints` (N,): those that have not failed, by cell."""
    order = by_cell(body.particles.x, grid, stencil)
    return order[intact_particles(body)[order]] if body.particles.y.ndim == 1 else order


def intact_particles(body):
    """Return True for each particle (N,) that has not failed."""
    out = np.empty(len(body.particles.y), dtype=bool)
    _mark_intact_all(body.particles.y, body.flow, out)
    return out


@kernel
def deformation(F, p, like):
    """F_p; of a field (N,) of determinants, the diagonal matrix (j, .., j, +-j) with that one."""
    if F.ndim == 3:
        return mat(F, p, like)
    else:
        j = abs(F[p]) ** (1.0 / len(like))
        last = -j if F[p] < 0.0 else j
        if len(like) == 2:
            return diag((j, last))
        else:
            return diag((j, j, last))


@kernel
def fill_points(particles, grid, stencil, order, out, bounds):
    """Base node, offset, F and V0 of the particles order[bounds[0]] .. order[bounds[1] - 1]."""
    d = grid.m.shape
    for k in range(bounds[0], bounds[1]):
        p = order[k]
        base, s = locate(vec(particles.x, p, d), grid, stencil)
        put_vec(out[0], k, base)
        put_vec(out[1], k, s)
        put_mat(out[2], k, deformation(particles.F, p, d))
        out[3][k] = particles.V0[p]


@kernel
def mark_intact(y, flow, out, bounds):
    """out_p = True where a particle of bounds[0] .. bounds[1] - 1 has not failed."""
    for p in range(bounds[0], bounds[1]):
        out[p] = intact(y[p], flow) > 0.0


@parallel
def _fill_points_all(particles, grid, stencil, order, out):
    for c in prange(CHUNKS):
        fill_points(particles, grid, stencil, order, out, chunk(c, len(order)))


@parallel
def _mark_intact_all(y, flow, out):
    for c in prange(CHUNKS):
        mark_intact(y, flow, out, chunk(c, len(y)))


# the differential of the stress

class StressModes(NamedTuple):
    """Differential of the stress of N `QuadraturePoints` in principal space.

    With F_p = U diag(s) V^T and W = F_p^n V, a velocity gradient L changes the stress that acts on
    the nodes by

        T = U Y W^T,    Y = apply(A, pairs, U^T L W)

    of `materials.principal`. A and pairs, here times dt^2 V0_p, may have their negative eigenvalues
    set to zero (HOT-alg1), so that the Hessian is positive semi-definite.
    """

    U: np.ndarray       # (N, d, d)
    W: np.ndarray       # (N, d, d)
    A: np.ndarray       # (N, d, d)           [kg m^2]
    ab: np.ndarray      # (N, d(d-1)/2, 2)    a and b of the pairs [kg m^2]


@kernel
def pairs_of(ab, p, like):
    """The pairs of particle p: ((a_01, b_01),) in 2D; those of (0, 1), (0, 2), (1, 2) in 3D."""
    if len(like) == 2:
        return ((ab[p, 0, 0], ab[p, 0, 1]),)
    else:
        return (
            (ab[p, 0, 0], ab[p, 0, 1]),
            (ab[p, 1, 0], ab[p, 1, 1]),
            (ab[p, 2, 0], ab[p, 2, 1]),
        )
