"""The incremental potential, whose minimiser is the velocity increment of a backward Euler step.

    E(dv) = sum_i m_i |dv_i|^2 / 2 + sum_p V0_p psi(F_p) - dt sum_i m_i b . (v_i + dv_i)    HOT-eq1
    g_i   = m_i dv_i + dt sum_p V0_p P_p (F_p^n)^T dw_ip - dt m_i b                         HOT-eq2
    F_p   = (I + dt L_p) F_p^n,    L_p = sum_i (v_i + dv_i) dw_ip^T

with the gravity b; heights are counted from the nodes at the start of the step. F_p^n is elastic:
return maps are lagged (HOT-sec3.1-seq), or part of psi (see `return_map`). Where g = 0, m_i dv_i/dt
is the force after the step. Where planes rub, the dissipation of `friction` is part of E.

The Hessian is an operator or a matrix (HOT-sec3.1-seq):

    (H u)_i = m_i u_i + sum_p T_p dw_ip,    T_p = dt^2 V0_p [dP/dF : (L_p F_p^n)] (F_p^n)^T

with L_p = sum_i u_i dw_ip^T. T_p is computed in principal space, see `quadrature.StressModes`.
"""

from copy import copy
from functools import cached_property

import numpy as np

from ..core import law as laws
from ..core.jit import CHUNKS, by_type, chunk, kernel, parallel, prange, total
from ..core.spectral import rotation, svd
from ..core.state import NONE, Grid
from ..core.tensor import (
    identity,
    inner,
    mat,
    mlin,
    mm,
    mmt,
    put_mat,
    transpose,
)
from ..materials import (
    FixedCorotated,
    Fluid,
    Hencky,
    LogNeoHookean,
    NeoHookean,
    YieldingHencky,
    fluid,
    hencky,
    yielding_hencky,
)
from ..materials.principal import apply, local, local_spd
from . import friction
from .assembly import assembled, diagonal, pattern_of
from .quadrature import StressModes, pairs_of, quadrature_points
from .return_map import law_of
from .transfer import add_forces, gradients, largest_velocity


class Potential:
    """E of the velocity increments dv (n, d) [m/s] of a step of dt [s], on the nodes `unknowns`.

    Particles may have any law and are not changed; gravity (d,) is an acceleration [m/s^2].
    `friction` is a `Friction` or None; return_map is that of `SolverOptions`.
    """

    friction = None

    def __init__(self, bodies, unknowns, stencil, dt, gravity, return_map="lagged"):
        self.bodies, self.unknowns, self.stencil, self.dt = bodies, unknowns, stencil, dt
        self.weight = unknowns.m[:, None] * np.asarray(gravity, dtype=float)
        self.box = box_of(unknowns)
        self.at = np.flatnonzero(unknowns.number.reshape(-1) >= 0)
        self.points = tuple(quadrature_points(body, self.box, stencil, return_map)
                            for body in bodies)

    def with_friction(self, friction):
        """Return this potential with a `Friction` or None; they share all arrays."""
        other = copy(self)
        other.friction = friction
        return other

    def with_unknowns(self, unknowns):
        """Return this potential with other conditions at the same nodes."""
        other = copy(self)
        other.unknowns = unknowns
        return other

    def energy(self, dv):
        """Return E(dv) [J]; inf where a law refuses a deformation gradient."""
        return self._energy(dv)

    def evaluate(self, dv):
        """Return E(dv) [J] and g = dE/d dv (n, d) [kg m/s], without conditions."""
        E = self._energy(dv)
        g = self.scatter_forces()
        g += self.unknowns.m[:, None] * dv
        g -= self.dt * self.weight
        self.add_friction(dv, g)
        return E, g

    def dissipated(self, dv):
        """Return the dissipation D [J] of the friction at dv, 0 where there is none."""
        if self.friction is None:
            return 0.0
        return friction.energy(self.friction, self.unknowns.v + dv)

    def add_friction(self, dv, g):
        """Add dD/du (n, d) [kg m/s] of the friction, where there is some, to g."""
        if self.friction is not None:
            friction.add_gradient(self.friction, self.unknowns.v + dv, g)

    def tangent(self, dv, projected=True):
        """Return the `Tangent` at dv: dP/dF of every particle, without its negative
        eigenvalues if projected (HOT-alg1).
        """
        self.gather_gradients(self.unknowns.v + dv)
        modes = tuple(stress_modes(points, body.law, self.dt, projected)
                      for body, points in zip(self.bodies, self.points))
        return Tangent(self, modes, self.friction_blocks(dv))

    def friction_blocks(self, dv):
        """Return the nodes (K,) that rub, and their blocks (K, d, d) of the Hessian [kg]."""
        if self.friction is None:
            return np.zeros(0, dtype=np.int64), np.zeros((0, dv.shape[1], dv.shape[1]))
        return self.friction.node, friction.blocks(self.friction, self.unknowns.v + dv)

    @cached_property
    def pattern(self):
        """`Pattern` of the Hessians."""
        return pattern_of(self.unknowns.number, len(self.stencil) - 1)

    def gather_gradients(self, u):
        """Velocity gradient of every particle, into points.T, of the nodal velocities u (n, d)."""
        self._load(u)
        for points in self.points:
            gradients(points, self.box, self.stencil)

    def largest_velocity(self, u):
        """Largest velocity [m/s] that the nodal velocities u (n, d) give to a particle."""
        self._load(u)
        return max((largest_velocity(points, self.box, self.stencil)
                    for points in self.points), default=0.0)

    def scatter_forces(self):
        """sum_p T_p dw_ip (n, d) of the T that the points hold."""
        self.box.f[:] = 0.0
        for points in self.points:
            add_forces(points, self.box, self.stencil)
        return self.box.f.reshape(-1, self.weight.shape[1])[self.at]

    def _load(self, u):
        self.box.v.reshape(-1, u.shape[1])[self.at] = u

    def _energy(self, dv):
        m, u = self.unknowns.m, self.unknowns.v + dv
        self.gather_gradients(u)
        E = total(np.einsum("n,na,na->n", 0.5 * m, dv, dv))
        E -= self.dt * total(np.einsum("na,na->n", self.weight, u))
        for body, points in zip(self.bodies, self.points):
            update_response(points, body.law, self.dt)
            E += total(points.psi)
        return float(E) + self.dissipated(dv)


def box_of(unknowns):
    """Zeroed grid with u (`v`) and f, over the nodes that `unknowns` numbers."""
    shape = unknowns.number.shape
    u, f = np.zeros((2, *shape, len(shape)))
    return Grid(np.zeros(shape), u, f, NONE, unknowns.origin, unknowns.dx)


# energy and stress of particles at the end of the step:
#
#     psi_p = V0_p psi(F_p),    T_p = dt V0_p P(F_p) (F_p^n)^T
#
# T_p is the derivative of psi_p with respect to L_p [J s]; HOT-eq2 sums T_p dw_ip.

energy_and_stress = by_type("energy_and_stress")      # (F, law) -> psi, P, at the cost of P alone


@kernel
def new_gradient(L, dt, F):
    """(I + dt L) F."""
    return mm(mlin(1.0, identity(F), dt, L), F)


@kernel
def energies_and_stresses(points, law, dt, like, bounds):
    """psi_p and T_p of the particles bounds[0] .. bounds[1] - 1; before, T_p holds L_p."""
    for p in range(bounds[0], bounds[1]):
        F_n = mat(points.F, p, like)
        F = new_gradient(mat(points.T, p, like), dt, F_n)
        psi, P = energy_and_stress(F, law_of(law, points.tau_y, p))
        points.psi[p] = points.V0[p] * psi
        put_mat(points.T, p, mlin(dt * points.V0[p], mmt(P, F_n), 0.0, F_n))


@kernel
def fixed_corotated_response(F, law):
    """psi, P of the fixed corotated law from one polar decomposition (NCLAW-eq12)."""
    D = mlin(1.0, F, -1.0, rotation(F))
    psi = law.mu * inner(D, D) + fluid.psi(F, law)
    return psi, mlin(2.0 * law.mu, D, 1.0, fluid.pk1(F, law))


@kernel
def direct_response(F, law):
    """psi, P of a law that needs no decomposition."""
    return laws.psi(F, law), laws.pk1(F, law)


energy_and_stress.method(FixedCorotated, fixed_corotated_response)
energy_and_stress.method(Hencky, hencky.psi_and_pk1)
energy_and_stress.method(YieldingHencky, yielding_hencky.psi_and_pk1)
for _law in (NeoHookean, LogNeoHookean, Fluid):
    energy_and_stress.method(_law, direct_response)


@parallel
def _energies_and_stresses_all(points, law, dt, like):
    for c in prange(CHUNKS):
        energies_and_stresses(points, law, dt, like, chunk(c, len(points.psi)))


def update_response(points, law, dt):
    """`energies_and_stresses` for all particles of a body."""
    _energies_and_stresses_all(points, law, dt, tuple(range(points.F.shape[1])))


# the Hessian

class Tangent:
    """Hessian H = d2E/d dv2 [kg] of a `Potential` at one dv, without conditions."""

    def __init__(self, potential, modes, of_friction):
        self.potential, self.modes, self.of_friction = potential, modes, of_friction

    def product(self, u):
        """H u (n, d), without a matrix."""
        self.potential.gather_gradients(u)
        for points, modes in zip(self.potential.points, self.modes):
            _stress_changes_all(points, modes, tuple(range(u.shape[1])))
        Hu = self.potential.scatter_forces() + self.potential.unknowns.m[:, None] * u
        node, blocks = self.of_friction
        Hu[node] += np.einsum("kab,kb->ka", blocks, u[node])
        return Hu

    def matrix(self):
        """Return H as a bsr_array of blocks (d, d), symmetric to the bit. A row has a block for
        every node in the stencil of 5^d (for quadratic splines) nodes around its own.
        """
        q, (node, blocks) = self.potential, self.of_friction
        H = assembled(tuple(zip(q.points, self.modes)), q.unknowns, q.pattern, q.stencil)
        H.data[q.pattern.diagonal[node]] += blocks
        return H

    def diagonal(self):
        """Return the diagonal blocks (n, d, d) of H, without the matrix [kg]."""
        q, (node, blocks) = self.potential, self.of_friction
        D = diagonal(tuple(zip(q.points, self.modes)), q.unknowns, q.stencil)
        D[node] += blocks
        return D


def stress_modes(points, law, dt, projected):
    """`StressModes` at the velocity gradients L that points.T holds."""
    n, d = points.s.shape
    square = (np.empty((n, d, d)) for _ in range(3))
    modes = StressModes(*square, np.empty((n, d * (d - 1) // 2, 2)))
    _differentiate_all(points, law, (dt, projected), modes, tuple(range(d)))
    return modes


@kernel
def differentiate(points, law, options, modes, like, bounds):
    """`StressModes` of the particles bounds[0] .. bounds[1] - 1; options are dt and projected."""
    dt, projected = options
    for p in range(bounds[0], bounds[1]):
        F_n = mat(points.F, p, like)
        U, s, V, _ = svd(new_gradient(mat(points.T, p, like), dt, F_n))
        own = law_of(law, points.tau_y, p)
        A, pairs = local_spd(s, own) if projected else local(s, own)
        scale = dt * dt * points.V0[p]
        put_mat(modes.U, p, U)
        put_mat(modes.W, p, mm(F_n, V))
        put_mat(modes.A, p, mlin(scale, A, 0.0, A))
        for k in range(len(pairs)):
            modes.ab[p, k, 0], modes.ab[p, k, 1] = scale * pairs[k][0], scale * pairs[k][1]


@kernel
def stress_changes(points, modes, like, bounds):
    """T_p of the particles bounds[0] .. bounds[1] - 1; before, T_p holds L_p."""
    for p in range(bounds[0], bounds[1]):
        U, W = mat(modes.U, p, like), mat(modes.W, p, like)
        X = mm(transpose(U), mm(mat(points.T, p, like), W))
        Y = apply(mat(modes.A, p, like), pairs_of(modes.ab, p, like), X)
        put_mat(points.T, p, mmt(mm(U, Y), W))


@parallel
def _differentiate_all(points, law, options, modes, like):
    for c in prange(CHUNKS):
        differentiate(points, law, options, modes, like, chunk(c, len(points.T)))


@parallel
def _stress_changes_all(points, modes, like):
    for c in prange(CHUNKS):
        stress_changes(points, modes, like, chunk(c, len(points.T)))
