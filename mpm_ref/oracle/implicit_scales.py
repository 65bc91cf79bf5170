"""The scales (see `scales`) of what an implicit step adds: potential, Hessian, its coarse products.

They are bounds of first order in double precision; sums over particles take the sizes of their
terms, laws the differences of the plain twin when F moves.
"""

from typing import NamedTuple

import numpy as np

from ..plain import transfer
from ..plain.spline import Pairs
from . import differential, scales
from .implicit_twin import as_matrices, density, kirchhoff_like, rest_stiffness
from .scales import size

EPS = float(np.finfo(np.float64).eps)


class Stiff(NamedTuple):
    """How one body's differential weighs on a velocity gradient L: T = V0 dP(L F_n) F_n^T."""

    k: np.ndarray       # (N,)  bound of |T| / (V0 |L|) [Pa]
    S: np.ndarray       # (N,)  scale of T / (V0 |L|) [Pa]


class Scales:
    """Scales of one step of a `SolvedTwin`; fields (n,) are on its nodes."""

    def __init__(self, twin):
        self.twin = twin
        self.dt, self.g = float(twin.dt), float(size(twin.gravity, 0))
        self.bodies = [as_floats(q) for q in twin.whole]
        self.clouds = [Pairs(ip.node, *(a.astype(float) for a in ip[1:])) for ip in twin.clouds]
        self.S = [scales.inputs(q, {}, EPS) for q in self.bodies]
        self.method = twin.method._replace(dx=np.float64(twin.method.dx))
        self.W = [scales.weights(ip, self.method, s.x) for ip, s in zip(self.clouds, self.S)]
        self.m = twin.m.astype(float)
        self.v = twin.v.astype(float)
        self.on_grid()

    def rows(self):
        """Particles, pairs and scales of every body."""
        return zip(self.bodies, self.clouds, self.S, self.W)

    def sum(self, terms):
        """Sums over the pairs of every body, over the box."""
        return sum(transfer.sum_to_nodes(a, ip, self.twin.box) for a, ip in zip(terms, self.clouds))

    def on_grid(self):
        """Scales of mass, momentum and velocity, over the box."""
        sums = [scales.to_grid(q, ip, self.twin.box, self.method, S, W)
                for q, ip, S, W in self.rows()]
        self.S_m, self.S_mv = (sum(a) for a in list(zip(*sums))[:2])
        self.swing = sum(scales.swing(q, ip, self.twin.box, self.v, (S, W))
                         for q, ip, S, W in self.rows())
        self.S_v = self.swing / np.where(self.m > 0, self.m, 1)

    def before(self):
        """{key: scale} of particles to grid, conditions and norms."""
        twin, q = self.twin, self.twin.unknowns
        found = {"mass": self.S_m, "momentum": self.S_mv, "velocity_old": self.S_v}
        found = {name: twin.nodal(a) for name, a in found.items()}
        speed = size(q.v) + found["velocity_old"] + size(q.dv0)
        found |= {"projector": np.ones(len(q.m)), "start": np.where(tied(q), speed, 0.0)
                  + self.dt * self.g, "kappa": self.kappa()}
        for name, W in zip(twin.names, self.W):
            found[f"{name}/weights"] = W.w
        return found

    def kappa(self):
        """Of the characteristic norms: an error of the masses counts where stiffnesses differ."""
        twin, d = self.twin, len(self.twin.gravity)
        kappa = twin.kappa().astype(float)
        unit = 2 * d * (2 * float(twin.method.dx)) ** (d - 1) * self.dt
        xi = [float(rest_stiffness(q.law, d, np.float64)) for q in self.bodies]
        parts = [transfer.sum_to_nodes(q.m[:, None] * (W.w + ip.w), ip, twin.box)
                 for q, ip, _, W in self.rows()]
        off = sum(abs(x * unit - kappa) * twin.nodal(a) for x, a in zip(xi, parts))
        return kappa + off / twin.unknowns.m

    def gradients(self, u, S_u, k):
        """Sizes and scales (N,) of the velocity gradients of body k."""
        ip, W = self.clouds[k], self.W[k]
        at = transfer.at(ip, self.twin.box)
        L = size(transfer.velocity_gradient(u, ip, self.twin.box))
        return L, scales.gradient(size(u, u.ndim - 1)[at], S_u[at], W)

    def strains(self, dv):
        """For every body, the scale (N,) of F at the increment dv (n, d)."""
        u = self.v + self.twin.over(dv).astype(float)
        S_u = self.S_v + size(self.twin.over(dv).astype(float), self.m.ndim)
        out = []
        for k, (q, S) in enumerate(zip(self.bodies, self.S)):
            L, S_L = self.gradients(u, S_u, k)
            F = size(q.F[:, None])
            out.append((1 + self.dt * (L + S_L)) * F + (1 + self.dt * L) * S.F)
        return out

    def potential(self, ats, dv):
        """Scales of E (1,) and of its gradient (n,) at the increment dv."""
        over = self.twin.over(dv).astype(float)
        a, S_F = size(over, self.m.ndim), self.strains(dv)
        E = (self.m + self.S_m) * (a * a + self.dt * self.g * (size(self.v, self.m.ndim) + a
                                                             + self.S_v))
        E, terms = E.sum(), []
        for k, q in enumerate(self.bodies):
            S_psi, T, S_T = responses(q, ats[k], S_F[k])
            terms.append(self.dt * self.pull(k, T, S_T + T))
            E += (q.V0 * S_psi).sum()
        inert = (self.m + self.S_m) * (a + self.dt * self.g)
        return np.array([E]), self.twin.nodal(self.sum(terms) + inert)

    def pull(self, k, T, S_T):
        """Scales (N, S) of V0 T dw of the pairs of body k."""
        W = self.W[k]
        return self.bodies[k].V0[:, None] * (W.dw * T[:, None] + W.size_dw * S_T[:, None])

    def stiff(self, ats, dv):
        """`Stiff` of every body at the increment dv."""
        return [stiffened(*body) for body in zip(self.bodies, ats, self.strains(dv))]

    def product(self, stiff, u, S_u):
        """Scale (n,) of H u, for u (n, d) with the scale S_u (n,)."""
        over, S_u = (self.twin.over(a).astype(float) for a in (u, S_u))
        terms = []
        for k, body in enumerate(stiff):
            L, S_L = self.gradients(over, S_u, k)
            terms.append(self.dt**2 * self.pull(k, body.k * L, body.S * L + body.k * S_L))
        speed = size(over, self.m.ndim)
        return self.twin.nodal(self.sum(terms) + (self.m + self.S_m) * (speed + S_u))


def responses(q, at, S_F):
    """Scale of psi; size and scale of P F_n^T of every particle at F with the scale S_F (N,)."""
    F, F_n = at.F.astype(float), at.F_n.astype(float)

    def both(G):
        return [density(G, q.law), kirchhoff_like(G, F_n, q.law)]

    S_psi, S_T = scales.through(both, F, S_F)
    return S_psi, size(both(F)[1]), S_T


def stiffened(q, at, S_F):
    """`Stiff` of one body at F with the scale S_F (N,)."""
    F, F_n = at.F.astype(float), size(at.F_n.astype(float))

    def whole(G):
        return [differential.components(differential.modes(G, q.law))]

    k, (S,) = differential.stiffness(differential.modes(F, q.law)), scales.through(whole, F, S_F)
    return Stiff(k * F_n**2, (S + 2 * k) * F_n**2)


def tied(unknowns):
    """Which nodes (n,) conditions hold or bear."""
    return (unknowns.B != np.eye(unknowns.B.shape[1])).any(axis=(1, 2))


def as_floats(q):
    """`Matter` in double precision, a fluid's F as matrices."""
    cast = {name: a.astype(float) for name, a in q._asdict().items() if isinstance(a, np.ndarray)}
    q = q._replace(**cast)
    return q._replace(F=as_matrices(q.F, q.x.shape[1])) if q.F.ndim == 1 else q
