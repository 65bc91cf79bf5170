"""The minimisation problem of a step: the potential, on the increments that conditions admit."""

from typing import NamedTuple

import numpy as np

from ..core.jit import CHUNKS, chunk, kernel, parallel, prange
from ..core.tensor import mat, mm, put_mat
from .rigid import RigidMotions


class Unknowns(NamedTuple):
    """n nodes in d dimensions; their numbers run along the grid, its first axis slowest.

    The increments dv that the conditions admit are dv0 + B w for any w (n, d).
    """

    number: np.ndarray    # (n1, .., nd)  number of each grid node; -1 without mass
    index: np.ndarray     # (n, d)        node index: the position is index * dx
    m: np.ndarray         # (n,)          mass [kg]
    v: np.ndarray         # (n, d)        velocity at the start of the step [m/s]
    B: np.ndarray         # (n, d, d)     symmetric projector on what the conditions leave free
    dv0: np.ndarray       # (n, d)        increment that the conditions ask for [m/s]
    origin: np.ndarray    # (d,)          index of the grid's first node
    dx: float             #               grid spacing [m]


def unknowns_of(grid, mass_eps=0.0):
    """`Unknowns` of a grid that holds mass and momentum, with no conditions. mass_eps [kg] is added
    to the mass of each node, as in the explicit step.
    """
    d = grid.m.ndim
    flat = np.flatnonzero(grid.m.reshape(-1) > 0.0)
    number = np.full(grid.m.size, -1, dtype=np.int32)
    number[flat] = np.arange(len(flat))
    index = np.stack(np.unravel_index(flat, grid.m.shape), axis=1) + grid.origin
    m = grid.m.reshape(-1)[flat] + mass_eps
    v = grid.v.reshape(-1, d)[flat] / m[:, None]
    B = np.tile(np.eye(d), (len(flat), 1, 1))
    number = number.reshape(grid.m.shape)
    return Unknowns(number, index, m, v, B, np.zeros_like(v), grid.origin, float(grid.dx))


def free_part(unknowns, u):
    """B u of a nodal field (n, d)."""
    return np.einsum("nab,nb->na", unknowns.B, u)


class System:
    """E(dv) for dv = dv0 + B w: values, projected gradients and Hessians (HOT-eq1, HOT-bc).

    kappa (n,) [kg m/s] are the characteristic norms (HOT-eq9); start (n, d) [m/s] the admissible
    increment to begin with; coarse_grids, a `geometric.CoarseGrids`, makes
    the coarser `matrices`.
    """

    def __init__(self, potential, unknowns, kappa, start, coarse_grids=None):
        self.potential, self.unknowns = potential, unknowns
        self.kappa, self.start, self.coarse_grids = kappa, start, coarse_grids
        self.index, self.n = unknowns.index, len(unknowns.m)
        self._at, self._tangent = None, None
        self._rigid = None

    def energy(self, dv):
        """Return E(dv) [J]."""
        return self.potential.energy(dv)

    def evaluate(self, dv):
        """Return E(dv) [J] and B dE/d dv (n, d) [kg m/s]."""
        E, g = self.potential.evaluate(dv)
        return E, self.project(g)

    def project(self, u):
        """B u (n, d)."""
        return free_part(self.unknowns, u)

    def particle_displacement(self, u):
        """Largest displacement [dx] of a particle in the step by nodal velocities u (n, d)."""
        return self.potential.largest_velocity(u) * self.potential.dt / self.unknowns.dx

    def balanced(self, dv):
        """Return dv (n, d) [m/s] with the balance of rigid motions; see `rigid.RigidMotions`."""
        if self._rigid is None:
            self._rigid = RigidMotions(self.potential, self.unknowns)
        return self._rigid.balanced(dv)

    def tangent(self, dv):
        """The potential's `Tangent` at dv; the last one is cached."""
        if self._at is None or not np.array_equal(dv, self._at):
            self._at, self._tangent = dv.copy(), self.potential.tangent(dv)
        return self._tangent

    def matrix(self, dv):
        """B H B at dv as a bsr_array: rows and columns of fixed directions are zero."""
        return constrained(self.tangent(dv).matrix(), self.unknowns.B)

    def matrices(self, dv, levels):
        """Return [(`matrix`, node indices)] at dv on grids of 1, 2, 4, ... times the spacing.

        Raises ValueError where the system was made without `coarse_grids`.
        """
        if self.coarse_grids is None:
            raise ValueError("a method with geometric multigrid on a System without coarser grids: "
                             "expected one made with coarse_grids = CoarseGrids(...)")
        modes = self.tangent(dv).modes
        return [(self.matrix(dv), self.index), *self.coarse_grids.matrices(modes, levels)]

    def product(self, dv, projected=True):
        """u -> B H B u at dv, without a matrix; H is that of `tangent`, or the exact one."""
        tangent = self.tangent(dv) if projected else self.potential.tangent(dv, projected)
        return lambda u: self.project(tangent.product(self.project(u)))

    def diagonal(self, dv):
        """Diagonal blocks (n, d, d) of B H B at dv, without the matrix [kg]."""
        B = self.unknowns.B
        return B @ self.tangent(dv).diagonal() @ B


def constrained(H, B):
    """B H B of a block matrix, in place: only blocks of a node that is not free are changed."""
    tied = (B != np.eye(B.shape[1])).any(axis=(1, 2))
    if tied.any():
        _project_all(H.data, H.indices, H.indptr, B, tied, tuple(range(B.shape[1])))
    return H


@kernel
def project(H, B, tied, like, bounds):
    """B_i H_ij B_j in the rows bounds[0] .. bounds[1] - 1 of H = (data, indices, indptr)."""
    data, indices, indptr = H
    for i in range(bounds[0], bounds[1]):
        for k in range(indptr[i], indptr[i + 1]):
            j = indices[k]
            if tied[i] or tied[j]:
                B_i, B_j = mat(B, i, like), mat(B, j, like)
                put_mat(data, k, mm(mm(B_i, mat(data, k, like)), B_j))


@parallel
def _project_all(data, indices, indptr, B, tied, like):
    for c in prange(CHUNKS):
        project((data, indices, indptr), B, tied, like, chunk(c, len(tied)))
