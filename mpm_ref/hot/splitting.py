"""The incremental potential with the particles' deformation split off, as ADMM takes it.

    min E_0(dv) + sum_p V0_p psi(Z_p)    under    F_p(dv) = Z_p                        (HOT-eq1)

with inertia and gravity E_0. The augmented Lagrangian, scaled multipliers Lambda_p, adds
sum_p V0_p k_p/2 |F_p - Z_p + Lambda_p|^2. Only Y_p = Lambda_p - Z_p is kept: at new dv, Lambda_p is
F_p + Y_p.
"""

import numpy as np
import scipy.sparse as sp

from ..core.jit import CHUNKS, chunk, kernel, parallel, prange
from ..core.spectral import svd
from ..core.tensor import diag, identity, mat, mlin, mm, mmt, put_mat
from .assembly import assembled
from .modes import Modes
from .norms import rest_stiffness
from .proximal import prox
from .response import moved


class Splitting:
    """State of the splitting of a `Potential`, with the multipliers zero at dv (n, d) [m/s].

    k_p [Pa] is `penalty` times the root mean square xi_p/d of the d^2 eigenvalues of d2psi/dF2 at
    rest (HOT-sec5.2).
    """

    def __init__(self, potential, dv, penalty):
        self.potential = potential
        d = dv.shape[1]
        self.k = tuple(penalty * rest_stiffness(body.law, d) / d for body in potential.bodies)
        self.Y = self._zero(dv)

    def _zero(self, dv):
        q = self.potential
        q.spread(q.unknowns.v + dv)
        return tuple(-(s.F + q.dt * s.T @ s.F) for s in q.sites)

    def local_step(self, dv):
        """New multipliers and Z_p at dv (n, d); then the gradient (n, d) [kg m/s] of the augmented
        Lagrangian with respect to dv, and how many proximal maps missed their tolerance.
        """
        q, missed = self.potential, 0
        q.spread(q.unknowns.v + dv)
        for body, sites, k, Y in zip(q.bodies, q.sites, self.k, self.Y):
            _split_all(sites, body.law, (q.dt, k), Y, tuple(range(dv.shape[1])))
            missed += len(sites.psi) - int(sites.psi.sum())
        return q.collect() + q.unknowns.m[:, None] * dv - q.dt * q.weight, missed

    def matrix(self):
        """K (n, n) [kg] of the global step, the same for every component and every iterate.

        K_ij = m_i delta_ij + dt^2 sum_p V0_p k_p (F_p^n^T dw_ip) . (F_p^n^T dw_jp)
        """
        q = self.potential
        modes = tuple(isotropic(s, q.dt * q.dt * k) for s, k in zip(q.sites, self.k))
        H = assembled(tuple(zip(q.sites, modes)), q.unknowns, q.pattern)
        n = len(q.unknowns.m)
        return sp.csr_array((H.data[:, 0, 0].copy(), H.indices, H.indptr), shape=(n, n))


def isotropic(sites, k):
    """`Modes` of the stress V0_p k L F_p^n (F_p^n)^T of a velocity gradient L."""
    n, d = sites.s.shape
    eye, stiffness = np.tile(np.eye(d), (n, 1, 1)), k * sites.V0[:, None, None]
    pairs = np.tile(stiffness, (1, d * (d - 1) // 2, 2))
    return Modes(eye, sites.F, stiffness * eye, pairs)


@kernel
def split(sites, law, options, Y, like, bounds):
    """Z_p, Y_p and the stress of the penalty of the particles bounds[0] .. bounds[1] - 1.

        Lambda = F + Y,  Z = prox(F + Lambda),  Y = Lambda - Z,  T = dt V0 k (F + Y) (F^n)^T

    Before, T_p holds L_p; after, psi_p is 1 where the proximal map was found, else 0.
    """
    dt, k = options
    for p in range(bounds[0], bounds[1]):
        F_n = mat(sites.F, p, like)
        F = moved(mat(sites.T, p, like), dt, F_n)
        multiplier = mlin(1.0, F, 1.0, mat(Y, p, like))
        U, s, V, _ = svd(mlin(1.0, F, 1.0, multiplier))
        z, sites.psi[p] = prox(s, k, law)
        Y_p = mlin(1.0, multiplier, -1.0, mmt(mm(U, diag(z)), V))
        put_mat(Y, p, Y_p)
        stress = mlin(dt * sites.V0[p] * k, mlin(1.0, F, 1.0, Y_p), 0.0, identity(like))
        put_mat(sites.T, p, mmt(stress, F_n))


@parallel
def _split_all(sites, law, options, Y, like):
    for c in prange(CHUNKS):
        split(sites, law, options, Y, like, chunk(c, len(sites.psi)))
