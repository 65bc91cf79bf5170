"""What the solvers see of a step: the potential, on the increments that the conditions admit."""

import numpy as np

from .diagonal import diagonal
from .unknowns import free_part


class System:
    """E(dv) for dv = dv0 + B w: values, projected gradients and Hessians (HOT-eq1, HOT-bc).

    kappa (n,) [kg m/s] are the characteristic norms (HOT-eq9); start (n, d) [m/s] the admissible
    increment to begin with.
    """

    def __init__(self, potential, unknowns, kappa, start):
        self.potential, self.unknowns = potential, unknowns
        self.kappa, self.start = kappa, start
        self.index, self.n = unknowns.index, len(unknowns.m)
        self._at, self._tangent = None, None

    def energy(self, dv):
        """E(dv) [J]."""
        return self.potential.energy(dv)

    def evaluate(self, dv):
        """E(dv) [J] and B dE/d dv (n, d) [kg m/s]."""
        E, g = self.potential.evaluate(dv)
        return E, self.free(g)

    def free(self, u):
        """B u (n, d)."""
        return free_part(self.unknowns, u)

    def tangent(self, dv):
        """The potential's `Tangent` at dv; the last one is kept."""
        if self._at is None or not np.array_equal(dv, self._at):
            self._at, self._tangent = dv.copy(), self.potential.tangent(dv)
        return self._tangent

    def matrix(self, dv):
        """B H B at dv as a bsr_array: rows and columns of what is held are zero."""
        return constrained(self.tangent(dv).matrix(), self.unknowns.B)

    def product(self, dv):
        """u -> B H B u at dv, without a matrix."""
        tangent = self.tangent(dv)
        return lambda u: self.free(tangent.product(self.free(u)))

    def diagonal(self, dv):
        """Diagonal blocks (n, d, d) of B H B at dv, without the matrix [kg]."""
        q, B, modes = self.potential, self.unknowns.B, self.tangent(dv).modes
        return B @ diagonal(zip(q.sites, modes), self.unknowns, q.stencil) @ B


def constrained(H, B):
    """B H B of a block matrix, in place: only blocks of a node that is not free are changed."""
    tied = np.flatnonzero((B != np.eye(B.shape[1])).any(axis=(1, 2)))
    is_tied = np.zeros(len(B), dtype=bool)
    is_tied[tied] = True
    row = np.repeat(np.arange(len(B)), np.diff(H.indptr))
    k = np.flatnonzero(is_tied[row])
    H.data[k] = B[row[k]] @ H.data[k]
    k = np.flatnonzero(is_tied[H.indices])
    H.data[k] = H.data[k] @ B[H.indices[k]]
    return H
