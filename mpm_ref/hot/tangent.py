"""The Hessian of the incremental potential, as an operator and as a matrix (HOT-sec3.1-seq).

    (H u)_i = m_i u_i + sum_p T_p dw_ip,    T_p = dt^2 V0_p [dP/dF : (L_p F_p^n)] (F_p^n)^T

with L_p = sum_i u_i dw_ip^T. T_p is computed in principal space, see `modes`.
"""

import numpy as np

from ..core.jit import CHUNKS, chunk, kernel, parallel, prange
from ..core.spectral import svd
from ..core.tensor import mat, mlin, mm, mmt, put_mat, transpose
from ..materials.principal import apply, local, local_spd
from .assembly import assembled
from .modes import Modes, pairs_of
from .response import moved


class Tangent:
    """Hessian H = d2E/d dv2 [kg] of a `Potential` at one dv, which knows no conditions."""

    def __init__(self, potential, modes):
        self.potential, self.modes = potential, modes

    def product(self, u):
        """H u (n, d), without a matrix."""
        self.potential.spread(u)
        for sites, modes in zip(self.potential.sites, self.modes):
            _stress_all(sites, modes, tuple(range(u.shape[1])))
        return self.potential.collect() + self.potential.unknowns.m[:, None] * u

    def matrix(self):
        """H as a bsr_array of blocks (d, d), symmetric to the bit; a row has a block for every node
        in the stencil of 5^d (for quadratic splines) nodes around its own.
        """
        q = self.potential
        return assembled(tuple(zip(q.sites, self.modes)), q.unknowns, q.pattern)


def differentials(sites, law, dt, projected):
    """`Modes` at the velocity gradients L that sites.T holds."""
    n, d = sites.s.shape
    square = (np.empty((n, d, d)) for _ in range(3))
    modes = Modes(*square, np.empty((n, d * (d - 1) // 2, 2)))
    _differentiate_all(sites, law, (dt, projected), modes, tuple(range(d)))
    return modes


@kernel
def differentiate(sites, law, options, modes, like, bounds):
    """`Modes` of the particles bounds[0] .. bounds[1] - 1; options are dt and projected."""
    dt, projected = options
    for p in range(bounds[0], bounds[1]):
        F_n = mat(sites.F, p, like)
        U, s, V, _ = svd(moved(mat(sites.T, p, like), dt, F_n))
        A, pairs = local_spd(s, law) if projected else local(s, law)
        scale = dt * dt * sites.V0[p]
        put_mat(modes.U, p, U)
        put_mat(modes.W, p, mm(F_n, V))
        put_mat(modes.A, p, mlin(scale, A, 0.0, A))
        for k in range(len(pairs)):
            modes.ab[p, k, 0], modes.ab[p, k, 1] = scale * pairs[k][0], scale * pairs[k][1]


@kernel
def stress(sites, modes, like, bounds):
    """T_p of the particles bounds[0] .. bounds[1] - 1; before, T_p holds L_p."""
    for p in range(bounds[0], bounds[1]):
        U, W = mat(modes.U, p, like), mat(modes.W, p, like)
        X = mm(transpose(U), mm(mat(sites.T, p, like), W))
        Y = apply(mat(modes.A, p, like), pairs_of(modes.ab, p, like), X)
        put_mat(sites.T, p, mmt(mm(U, Y), W))


@parallel
def _differentiate_all(sites, law, options, modes, like):
    for c in prange(CHUNKS):
        differentiate(sites, law, options, modes, like, chunk(c, len(sites.T)))


@parallel
def _stress_all(sites, modes, like):
    for c in prange(CHUNKS):
        stress(sites, modes, like, chunk(c, len(sites.T)))
