"""ADMM, the comparator of HOT's Figure 16 (HOT-methods; [RPIC], Fang et al. 2019).

The particles' deformation is split off the incremental potential:

    min E_0(dv) + sum_p V0_p psi(Z_p)    under    F_p(dv) = Z_p                        (HOT-eq1)

with inertia and gravity E_0. The augmented Lagrangian, scaled multipliers Lambda_p, adds
sum_p V0_p k_p/2 |F_p - Z_p + Lambda_p|^2. An iteration is

    Z_p, multipliers:  local, see `prox`             K (dv' - dv) = -(gradient of the Lagrangian)

HOT prints no formulas. This is the plain splitting of its potential; what we assume: constant
penalties that follow the stiffness at rest, multipliers zero at first, no relaxation, one local
and one global step per iteration, the latter by CG with Jacobi's preconditioner to a share of its
right-hand side. Only elasticity is split: the return map stays lagged, as in all methods here.
A first-order method: it converges linearly, and energies may rise on the way; there is no line
search. For potentials that are not convex a penalty that is too small may end in a cycle, which the
report says. The residual is that of the potential itself (HOT-eq9), so that all methods stop alike.
"""

from math import isfinite

import numpy as np
import scipy.sparse as sp

from ..core.jit import CHUNKS, chunk, kernel, parallel, prange
from ..core.spectral import svd
from ..core.tensor import (
    cofactor,
    det,
    diag,
    dot,
    identity,
    lin,
    mat,
    mlin,
    mm,
    mmt,
    mv,
    norm,
    put_mat,
    total_of,
)
from ..materials.principal import dpk1_hat, pk1_hat, semidefinite
from .assembly import assembled
from .krylov import CGOptions
from .line_search import Iterate
from .linearization import Linearization, solve
from .norms import rest_stiffness
from .potential import new_gradient
from .quadrature import StressModes

SHARE = 0.1     # of its right-hand side, in the energy norm, to which a global step is solved


class ADMM:
    """Iterates of ADMM on a `System`, from the increment dv (n, d) where it stands.

    `penalty` is that of `Splitting`, `cap` bounds CG; `profiler` counts.
    """

    def __init__(self, system, penalty, cap, profiler):
        self.system, self.penalty, self.profiler = system, penalty, profiler
        self.rule = CGOptions(lambda size: SHARE, cap)
        self.splitting = None

    def advance(self, now):
        """Return (next `Iterate`, None), whatever its energy."""
        if self.splitting is None:
            self._begin(now.dv)
        with self.profiler.part("local"):
            g, missed = self.splitting.local_step(now.dv)
        self.profiler.capped_solves += missed > 0
        dv = now.dv + solve(self.linear, -self.system.project(g), self.rule, self.profiler)
        return Iterate(dv, *self.system.evaluate(dv)), None

    def _begin(self, dv):
        self.splitting = Splitting(self.system.potential, dv, self.penalty)
        with self.profiler.part("assembly"):
            K = self.splitting.matrix()
        self.profiler.hessians += 1
        self.linear = component_linearization(K, self.system.project)


def component_linearization(K, project):
    """`Linearization` of B (K x I) on u = B u, for a matrix K (n, n) and project(u) = B u."""
    inverse = (1.0 / K.diagonal())[:, None]
    return Linearization(lambda u: project(K @ u), lambda r: project(inverse * r))


# the potential with the deformation split off


class Splitting:
    """State of the splitting of a `Potential`, with the multipliers zero at dv (n, d) [m/s].

    Only Y_p = Lambda_p - Z_p is stored: at new dv, Lambda_p is F_p + Y_p.

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
        q.gather_gradients(q.unknowns.v + dv)
        return tuple(-(s.F + q.dt * s.T @ s.F) for s in q.points)

    def local_step(self, dv):
        """New multipliers and Z_p at dv (n, d); then the gradient (n, d) [kg m/s] of the augmented
        Lagrangian with respect to dv, and how many proximal maps missed their tolerance.
        """
        q, missed = self.potential, 0
        q.gather_gradients(q.unknowns.v + dv)
        for body, points, k, Y in zip(q.bodies, q.points, self.k, self.Y):
            _split_all(points, body.law, (q.dt, k), Y, tuple(range(dv.shape[1])))
            missed += len(points.psi) - int(points.psi.sum())
        return q.scatter_forces() + q.unknowns.m[:, None] * dv - q.dt * q.weight, missed

    def matrix(self):
        """K (n, n) [kg] of the global step, the same for every component and every iterate.

        K_ij = m_i delta_ij + dt^2 sum_p V0_p k_p (F_p^n^T dw_ip) . (F_p^n^T dw_jp)
        """
        q = self.potential
        modes = tuple(isotropic_modes(s, q.dt * q.dt * k) for s, k in zip(q.points, self.k))
        H = assembled(tuple(zip(q.points, modes)), q.unknowns, q.pattern, q.stencil)
        n = len(q.unknowns.m)
        return sp.csr_array((H.data[:, 0, 0].copy(), H.indices, H.indptr), shape=(n, n))


def isotropic_modes(points, k):
    """`StressModes` of the stress V0_p k L F_p^n (F_p^n)^T of a velocity gradient L."""
    n, d = points.s.shape
    eye, stiffness = np.tile(np.eye(d), (n, 1, 1)), k * points.V0[:, None, None]
    pairs = np.tile(stiffness, (1, d * (d - 1) // 2, 2))
    return StressModes(eye, points.F, stiffness * eye, pairs)


@kernel
def split_points(points, law, options, Y, like, bounds):
    """Z_p, Y_p and the stress of the penalty of the particles bounds[0] .. bounds[1] - 1.

        Lambda = F + Y,  Z = prox(F + Lambda),  Y = Lambda - Z,  T = dt V0 k (F + Y) (F^n)^T

    Before, T_p holds L_p; after, psi_p is 1 where the proximal map was found, else 0.
    """
    dt, k = options
    for p in range(bounds[0], bounds[1]):
        F_n = mat(points.F, p, like)
        F = new_gradient(mat(points.T, p, like), dt, F_n)
        multiplier = mlin(1.0, F, 1.0, mat(Y, p, like))
        U, s, V, _ = svd(mlin(1.0, F, 1.0, multiplier))
        z, points.psi[p] = prox(s, k, law)
        Y_p = mlin(1.0, multiplier, -1.0, mmt(mm(U, diag(z)), V))
        put_mat(Y, p, Y_p)
        stress = mlin(dt * points.V0[p] * k, mlin(1.0, F, 1.0, Y_p), 0.0, identity(like))
        put_mat(points.T, p, mmt(stress, F_n))


@parallel
def _split_all(points, law, options, Y, like):
    for c in prange(CHUNKS):
        split_points(points, law, options, Y, like, chunk(c, len(points.psi)))


# the proximal map of an elastic energy, in principal space: the local step
#
#     Z = argmin psi(Z) + k/2 |Z - A|^2,    A = U diag(s) V^T,    Z = U diag(z) V^T
#
# psi is isotropic, so that Z shares the axes of A, and z solves pk1_hat(z) + k (z - s) = 0.
# Newton's method from z = s, on the Hessian without its negative eigenvalues: it descends, so that
# where there are several minimisers the nearest is found, and there is one only if k exceeds the
# law's concavity. Steps are halved by the slopes at their ends, since energies would need a
# decomposition each.


CAP = 50            # Newton steps; a few suffice
HALVINGS = 30       # of each
ROUND_OFF = 1e-13   # gradient over stiffness and size, at which z is found
OVERSHOT = 0.9      # share of the first slope that a step may end with, upwards
LEAST = 0.1         # stretch to begin with where the law has no stress at s


@kernel
def prox(s, k, law):
    """z of the stretches s, for a penalty k [Pa], and 1.0 if round-off was reached, else 0.0."""
    z = initial_stretches(s, law)
    r = residual(z, s, k, law)
    for _ in range(CAP):
        H = mlin(1.0, semidefinite(dpk1_hat(z, law)), k, identity(s))
        if norm(r) <= ROUND_OFF * norm(mv(H, lin(1.0, s, 1.0, z))):
            return z, 1.0
        p = mv(cofactor(H), lin(-1.0 / det(H), r, 0.0, r))
        z, r, moved = line_search_step(z, r, p, (s, k), law)
        if not moved:
            return z, 0.0
    return z, 0.0


@kernel
def residual(z, s, k, law):
    """pk1_hat(z) + k (z - s) [Pa]."""
    return lin(1.0, pk1_hat(z, law), k, lin(1.0, z, -1.0, s))


@kernel
def initial_stretches(s, law):
    """s, or stretches for which the law has a stress."""
    if isfinite(total_of(pk1_hat(s, law))):
        return s
    elif len(s) == 2:
        return max(abs(s[0]), LEAST), max(abs(s[1]), LEAST)
    else:
        return max(abs(s[0]), LEAST), max(abs(s[1]), LEAST), max(abs(s[2]), LEAST)


@kernel
def line_search_step(z, r, p, target, law):
    """z and its residual after a step along p that does not climb, and whether there was one."""
    s, k = target
    slope, alpha = dot(r, p), 1.0
    for _ in range(HALVINGS):
        trial = lin(1.0, z, alpha, p)
        r_new = residual(trial, s, k, law)
        if dot(r_new, p) <= -OVERSHOT * slope:      # NaN is refused
            return trial, r_new, True
        alpha *= 0.5
    return z, r, False
