"""Solvers of the coarsest level: conjugate gradients with HOT's inexact stop, or direct.

HOT's stop is relative: sqrt(r^T D^+ r) <= tolerance sqrt(b^T D^+ b), D the diagonal, or the
diagonal blocks, of the coarsest matrix (HOT-sec5.3-coarse). What b is reads in two ways; see `stop`
in `options`. The inexact solve makes the V-cycle slightly non-linear; a direct one does not.
"""

from functools import partial
from math import sqrt

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
import scipy.sparse.linalg as spla

from ...core.blas import one_thread
from ..krylov import CGOptions, pcg
from ..norms import dot
from .projectors import block_diagonal
from .smoothers import times

DENSE = 600       # unknowns up to which "direct" factorises a dense matrix
SHIFT = 1e-14     # of its diagonal: above round-off, below all that matters
CAP = 10_000      # iterations of conjugate gradients, as in HOT-methods


def scalar_inverses(D, B):
    """Inverse diagonals (n, d, d) for Jacobi by components: the diagonal D_aa of D, 0 where it is
    held. For a slip plane askew the projector B keeps the result in the free directions.
    """
    d = D.shape[1]
    diagonal = np.einsum("iaa->ia", D)
    scale = diagonal.max(axis=1, keepdims=True, initial=0.0)
    free = diagonal > 1e-13 * scale
    inverse = np.where(free, 1.0 / np.where(free, diagonal, 1.0), 0.0)
    return B @ (inverse[:, :, None] * np.eye(d)) @ B


def energy_norm(b, D_inv):
    """sqrt(b^T D^+ b) [sqrt(J)] of b (n, d), in which HOT's stop is measured."""
    return sqrt(max(0.0, dot(b, times(D_inv, b))))


def solve_by_cg(apply, D_inv, b, enough):
    """(u, iterations): A u = b from u = 0 until sqrt(r^T D^+ r) <= enough, b and u (n, d)."""
    rule = CGOptions(lambda own: enough / own, CAP)
    solved = pcg(apply, b, partial(times, D_inv), rule)
    return solved.x, solved.iterations


class Direct:
    """Exact solver: dense Cholesky up to DENSE unknowns, sparse LU beyond.

    Held directions are decoupled by a diagonal block of the matrix's own size, then masked. Where
    more coarse nodes than fine ones meet, P loses rank and the coarse matrix is singular; its null
    vectors do nothing, P n = 0, and a shift of the diagonal by SHIFT keeps factors finite.
    """

    def __init__(self, A, D, B):
        d = D.shape[1]
        scale = np.trace(D, axis1=1, axis2=2)[:, None, None]
        held = np.where(scale > 0.0, scale, 1.0) * (np.eye(d) - B)
        full = sp.csc_array(A + block_diagonal(held))
        self.B = B
        if full.shape[0] <= DENSE:
            with one_thread():
                self.solve = partial(la.cho_solve, _cholesky(full.toarray()))
        else:
            shifted = sp.csc_array(full + SHIFT * sp.diags_array(full.diagonal()))
            symmetric = {"permc_spec": "MMD_AT_PLUS_A", "diag_pivot_thresh": 0.0,
                         "options": {"SymmetricMode": True}}
            with one_thread():
                self.solve = spla.splu(shifted, **symmetric).solve

    def __call__(self, b):
        """u (n, d) of A u = b (n, d)."""
        with one_thread():
            u = self.solve(times(self.B, b).reshape(-1))
        return times(self.B, u.reshape(b.shape))


def _cholesky(A):
    """Factor of A with its diagonal raised by SHIFT, or by as much more as round-off demands."""
    diagonal, shift = np.diagonal(A).copy(), SHIFT
    while True:
        np.fill_diagonal(A, diagonal * (1.0 + shift))
        try:
            return la.cho_factor(A)
        except la.LinAlgError:
            shift *= 10.0


def coarsest_solver(level, choices):
    """Direct solver of the coarsest level, or None, and the inverse diagonals of its CG."""
    direct = Direct(level.A, level.D, level.B) if choices.coarsest == "direct" else None
    scalar = choices.preconditioner == "scalar"
    return direct, scalar_inverses(level.D, level.B) if scalar else level.D_inv
