"""Smoothers of the multigrid, readable on SciPy matrices (HOT-smoother).

A smoother is a symmetric positive map r -> du that approximates the inverse of A: Gauss-Seidel
forth and back, weighted Jacobi, Chebyshev polynomials. All work on blocks of d components and use
the pseudo-inverse of diagonal blocks, so that held directions stay zero.
"""

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla

from ..norms import dot
from .projectors import block_diagonal

SLAB = 4          # nodes along the first axis that are swept in order
POWER = 15        # iterations for the largest eigenvalue
SAFETY = 1.1      # power iteration is a lower bound
LOWEST = 1 / 8    # Chebyshev damps from here to 1, in units of the largest eigenvalue
DEGREE = 3        # of the Chebyshev polynomial
DAMPING = 4 / 3   # of Jacobi, over the largest eigenvalue: damps the upper half by 1/3 or more


def coloured(index, width=SLAB):
    """Order (n,) of the sweep over nodes with world indices index (n, d): slabs of `width` nodes
    along the first axis, those of even number first.

    Slabs of one colour do not couple, so the order within a colour is free: the same result for
    any number of threads. Nodes are numbered lexicographically.
    """
    return np.argsort((index[:, 0] // width) % 2, kind="stable")


class GaussSeidel:
    """One symmetric sweep from zero: M = (D + U)^+ D (D + L)^+ in the coloured order."""

    def __init__(self, A, D_inv, index):
        d = A.blocksize[0]
        self.order = (coloured(index)[:, None] * d + np.arange(d)).reshape(-1)
        blocks = sp.csr_array(A)[self.order][:, self.order]
        row = np.repeat(np.arange(A.shape[0]) // d, np.diff(blocks.indptr))
        below, above = blocks.copy(), blocks.copy()
        below.data = np.where(blocks.indices // d < row, blocks.data, 0.0)
        above.data = np.where(blocks.indices // d > row, blocks.data, 0.0)
        self.D_inv = sp.csr_array(block_diagonal(D_inv))[self.order][:, self.order]
        self.U = above
        self.forward = _unit_triangular(self.D_inv @ below)
        self.backward = _unit_triangular(self.D_inv @ above)

    def __call__(self, r):
        """du of residual r (n d,): solves (D + L) y = r, then (D + U) du = D y."""
        y = self.forward(self.D_inv @ r[self.order])
        du = np.empty_like(r)
        du[self.order] = self.backward(y)
        return du


def _unit_triangular(T):
    """Solver of (I + T) x = b for T strictly lower or strictly upper triangular: no fill, no
    pivots.
    """
    keep = {"permc_spec": "NATURAL", "diag_pivot_thresh": 0.0}
    return spla.splu(sp.csc_array(sp.eye_array(T.shape[0]) + T), **keep).solve


def largest_eigenvalue(apply, D_inv, index):
    """Upper estimate of the largest eigenvalue of D^+ A by power iteration, apply(u (n, d)) = A u.

    The start is a rough field of the world indices (n, d): held nodes leave no trace in it. The
    Rayleigh quotient is taken in the inner product of D.
    """
    d = index.shape[1]
    phase = index @ np.array([2.3, 1.9, 2.7])[:d]
    u = times(D_inv, np.cos(phase[:, None] + np.arange(d)))
    value = 0.0
    for _ in range(POWER):
        size = dot(u, u) ** 0.5
        if size == 0.0:
            return 1.0
        u /= size
        v = apply(u)
        w = times(D_inv, v)
        u, value = w, dot(v, w) / dot(u, v)     # <w, w>_D over <u, w>_D
    return SAFETY * value


def times(blocks, u):
    """Block-diagonal product (n, d) of blocks (n, d, d) and u (n, d)."""
    return np.einsum("iab,ib->ia", blocks, u)


def jacobi(apply, D_inv, r, largest):
    """du = omega D^+ r with omega = DAMPING / largest."""
    return DAMPING / largest * times(D_inv, r)


def chebyshev(apply, D_inv, r, largest):
    """du = p(D^+ A) D^+ r, where 1 - x p(x) is the Chebyshev polynomial of degree DEGREE that is
    smallest on [LOWEST, 1] times the largest eigenvalue.
    """
    centre, half = 0.5 * (1 + LOWEST) * largest, 0.5 * (1 - LOWEST) * largest
    ratio = half / centre
    rho = ratio
    step = times(D_inv, r) / centre
    du = step
    for _ in range(DEGREE - 1):
        r = r - apply(step)
        rho_new = 1.0 / (2.0 / ratio - rho)
        step = rho_new * rho * step + 2.0 * rho_new / half * times(D_inv, r)
        du = du + step
        rho = rho_new
    return du


POLYNOMIAL = {"jacobi": jacobi, "chebyshev": chebyshev}
