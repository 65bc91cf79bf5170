"""The stages of one implicit step by the plain twin, in extended precision.

Conditions, the nodes of the coarse levels and the accepted velocities are taken from the kernels as
they are; all else is computed from the particles. The Hessian is a product, never a matrix, on all
levels: coarse ones are R H P, one factor after the other.
"""

from itertools import pairwise
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp

from ..plain import potential, transfer
from ..plain.flows import intact
from ..plain.laws import energy, energy_and_stress
from ..plain.spline import bspline, pairs
from ..plain.step import Nodes, StepStages, deform, grid_to_particles, new_state
from ..plain.tensors import compose, det, svd
from . import differential, error_bounds
from .plain_twin import REAL, Twin, aligned, values_at

DEGREE = {"linear": 1, "quadratic": 2}      # of the splines of HOT-sec4.2-kernel


class At(NamedTuple):
    """One body at an increment."""

    A: np.ndarray           # (N, d, d)  growth
    F: np.ndarray           # (N, d, d)  deformation gradient there
    F_n: np.ndarray         # (N, d, d)  and before
    modes: differential.Modes


class SolvedTwin(Twin):
    """The plain twin of an implicit problem, at the start of one step of dt [s]."""

    def __init__(self, problem, unknowns, dt, real=REAL, rng=None):
        """With a random generator `rng`, the state and the projectors are off by up to an ulp."""
        super().__init__(problem, real, rng)
        self.dt, self.unknowns = self.real(dt), unknowns
        self.B = unknowns.B.astype(self.real)
        if rng is not None:
            self.bodies = [error_bounds.perturbed_body(q, rng) for q in self.bodies]
            self.B = error_bounds.perturbed(self.B, rng, np.ones(len(self.B)))
        self.whole = [q._replace(V0=q.V0 * (1 if q.y is None else intact(q.y, q.flow)))
                      for q in self.bodies]
        self.stencils = [pairs(q.x, self.method.dx, self.method.degree) for q in self.bodies]
        box = transfer.box_of(*self.stencils)
        both = list(zip(self.bodies, self.stencils))
        self.m = sum(transfer.mass(q.m, ip, box) for q, ip in both)
        self.mv = sum(transfer.momentum(q.m, q.v, q.C, ip, box) for q, ip in both)
        self.v = self.mv / np.where(self.m > 0, self.m, 1)[..., None]
        self.box = box

    def over(self, u):
        """A nodal field (n, ..) over the box; nodes outside of it carry nothing."""
        k = self.unknowns.index - self.box.first
        inside = ((k >= 0) & (k < self.box.shape)).all(axis=1)
        out = np.zeros((*self.box.shape, *u.shape[1:]), self.real)
        out[tuple(k[inside].T)] = u[inside]
        return out

    def nodal(self, a):
        """An array over the box on the nodes (n, ..)."""
        return values_at(a, self.box, self.unknowns.index)

    def before(self, bases=None):
        """Return {key: array} as `implicit_stages.before`, without conditions and norms.

        Weights are those of the stencils that begin at bases[body name], by default the twin's.
        """
        arrays = {"mass": self.m, "momentum": self.mv, "velocity_old": self.v}
        arrays = {name: self.nodal(a) for name, a in arrays.items()}
        for name, ip in zip(self.names, self.stencils):
            base = ip.node[:, 0]
            arrays[f"{name}/weights"] = ip.w if bases is None else aligned(ip.w, base, bases[name])
        return arrays

    def before_solve(self, given, operands, levels):
        """Return {key: array} of all stages before the solve, V-cycle and direction left out.

        given = (bases, start) has the first nodes of the particles' stencils and what the solve
        starts from, as the kernels see them; `operands` are those of `implicit_stages.draw`, and
        `levels` = (the levels of the kernels' hierarchy, the kernel of their embedding), or None.
        """
        bases, start = given
        arrays = self.before(bases) | self.conditions() | {"kappa": self.kappa()}
        for name, dv in (("start", start), ("trial", operands.trial)):
            ats = self.at(dv)
            E, g = self.potential(dv)
            arrays |= {f"E_{name}": E, f"gradient_{name}": g,
                       f"product_{name}": self.product(ats, operands.probe)}
            if name == "start" and levels is not None:
                arrays |= self.coarse(ats, operands.coarse, *levels)
        return arrays

    def coarse(self, ats, probes, levels, kernel):
        """Return {key: array} of prolongations and coarse products, for the vectors `probes` on the
        nodes of the coarse levels.
        """
        W = [embedding(fine.index, coarse.index, kernel) for fine, coarse in pairwise(levels)]
        B = [self.B, *(level.B.astype(self.real) for level in levels[1:])]
        arrays = {}
        for k, u in enumerate(probes, 1):
            u = u.astype(self.real)
            for l in reversed(range(k)):
                u = spread(W[l], B[l], u)
                if l == k - 1:
                    arrays[f"prolonged{k}"] = u
            g = self.product(ats, u)
            for l in range(k):
                g = collected(W[l], B[l], g)
            arrays[f"coarse{k}"] = g
        return arrays

    def conditions(self):
        """{key: array} that must follow from the kernels' projectors and increments: a projector is
        3 B^2 - 2 B^3 of itself, and what conditions ask for has no free part.
        """
        B, dv0 = self.B, self.unknowns.dv0.astype(self.real)
        B2 = np.einsum("nab,nbc->nac", B, B)
        start = dv0 - np.einsum("nab,nb->na", B, dv0)
        return {"projector": 3 * B2 - 2 * np.einsum("nab,nbc->nac", B2, B), "start": start}

    def kappa(self):
        """Characteristic norms (n,) [kg m/s] (HOT-eq9)."""
        d = self.gravity.shape[0]
        xi = [rest_stiffness(q.law, d, self.real) for q in self.bodies]
        shares = [transfer.mass(q.m, ip, self.box) for q, ip in zip(self.bodies, self.stencils)]
        m = self.nodal(self.m)
        mean = self.nodal(sum(x * a for x, a in zip(xi, shares))) / np.where(m > 0, m, 1)
        return mean * 2 * d * (2 * self.method.dx) ** (d - 1) * self.dt

    def potential(self, dv):
        """E (1,) [J] and its gradient (n, d) on what is free [kg m/s]."""
        bodies = [(q, ip, self.box) for q, ip in zip(self.whole, self.stencils)]
        E, g = potential.evaluate(bodies, self.m, self.v, self.over(dv), self.dt, self.gravity)
        return np.array([E]), self.project(self.nodal(g))

    def project(self, u):
        """Return B u."""
        return np.einsum("nab,nb->na", self.B, u)

    def at(self, dv):
        """`At` of every body at the increment dv (n, d)."""
        v = self.v + self.over(dv)
        return [self._at(q, ip, v) for q, ip in zip(self.bodies, self.stencils)]

    def _at(self, q, ip, u):
        A, F_n = potential.growth(u, self.dt, ip, self.box), as_matrices(q.F, self.gravity.shape[0])
        F = np.einsum("pab,pbc->pac", A, F_n)
        return At(A, F, F_n, differential.modes(F, q.law))

    def product(self, ats, u):
        """B H B u (n, d) [kg m/s]."""
        u = self.over(self.project(u))
        total = self.m[..., None] * u
        for q, ip, at in zip(self.whole, self.stencils, ats):
            dF = np.einsum("pab,pbc->pac", transfer.velocity_gradient(u, ip, self.box), at.F_n)
            T = np.einsum("pab,pcb->pac", differential.applied(at.modes, dF), at.F_n)
            total -= self.dt**2 * transfer.internal_force(q.V0, T, ip, self.box)
        return self.project(self.nodal(total))

    def after_solve(self, v):
        """Return {key: array} of particles and deformation under the nodal velocities v (n, d).

        The bodies advance.
        """
        arrays = self.arrays(self.advance(v.astype(self.real)), self.unknowns.index)
        return {key: a for key, a in arrays.items()
                if "/" in key and not key.endswith("/weights")}

    def advance(self, v):
        """Return the `plain.step.StepStages` under the nodal velocities v (n, d)."""
        grid = Nodes(self.box, self.m, self.mv, 0 * self.mv, self.v, self.over(v))
        both = zip(self.bodies, self.stencils)
        motions = [grid_to_particles(q, ip, grid, self.method, self.dt) for q, ip in both]
        motions = [self.clipped(motion) for motion in motions]
        updates = [deform(q, motion.L, self.dt) for q, motion in zip(self.bodies, motions)]
        self.bodies = [new_state(*body) for body in zip(self.bodies, motions, updates)]
        return StepStages(self.stencils, grid, motions, updates, self.dt)


def as_matrices(F, d):
    """F (N, d, d); of a fluid the multiple of I that has its determinant (N,)."""
    if F.ndim == 3:
        return F
    return (F ** (1 / F.dtype.type(d)))[:, None, None] * np.eye(d, dtype=F.dtype)


def rest_stiffness(law, d, real):
    """||dP/dF||_F at F = I [Pa] (HOT-sec5.2)."""
    s = np.ones((1, d), real)
    A, (a, b) = differential.slopes(s, law), differential.quotients(s, law)
    return np.sqrt((A * A).sum() + (a * a + b * b).sum() / 2)


def kirchhoff_like(F, F_n, law):
    """P (F_n)^T (N, d, d) [Pa] at F, the stress that acts on the nodes (HOT-eq2)."""
    U, s, V = svd(F)
    P = compose(U, energy_and_stress(s, law)[1] / s, V)
    return np.einsum("pab,pcb->pac", P, F_n)


def density(F, law):
    """psi (N,) of F (N, d, d) of any law."""
    return energy(det(F), law) if type(law).__name__ == "Fluid" else energy(F, law)


def embedding(fine, coarse, kernel):
    """Weights (n, m) of nodes with the world indices fine (n, d) on those of the next level (m, d):
    prod_a N(i_a/2 - c_a) (HOT-eq3), exact in floats.
    """
    degree = DEGREE[kernel]
    w = np.ones((len(fine), len(coarse)))
    for i, c in zip(fine.T, coarse.T):
        w *= bspline((i[:, None] - 2 * c) / 2 + (degree + 1) / 2, degree)
    return sp.coo_array(w)


def spread(W, B, u):
    """P u: blocks W_ic B_i (HOT-eq4)."""
    out = np.zeros((W.shape[0], *u.shape[1:]), u.dtype)
    np.add.at(out, W.row, W.data[:, None] * u[W.col])
    return np.einsum("nab,nb->na", B, out)


def collected(W, B, g):
    """R g = P^T g (HOT-eq5)."""
    out = np.zeros((W.shape[1], *g.shape[1:]), g.dtype)
    np.add.at(out, W.col, W.data[:, None] * np.einsum("nab,nb->na", B, g)[W.row])
    return out
