"""The stages of one implicit step by the plain twin, in extended precision.

Conditions, the nodes of the coarse levels and the accepted velocities are those of the kernels; all
else is computed from the particles. The Hessian is a product on all levels, never a matrix: the
coarse ones are R H P, one factor after the other.
"""

from itertools import pairwise
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp

from ..plain import potential, transfer
from ..plain.flows import intact
from ..plain.spline import bspline, pairs
from ..plain.step import Nodes, StepStages, deform, grid_to_particles, new_state
from . import error_bounds
from .differential import (
    StressDifferential,
    apply_differential,
    difference_quotients,
    slopes,
    stress_differential,
)
from .plain_twin import REAL, Twin, align, values_at

DEGREE = {"linear": 1, "quadratic": 2}      # of the splines of HOT-sec4.2-kernel


class BodyTangent(NamedTuple):
    """The deformation and the stress differential of one body at an increment."""

    F_n: np.ndarray         # (N, d, d)  deformation gradient before the step
    differential: StressDifferential


class ImplicitTwin(Twin):
    """The plain twin of an implicit problem, at the start of one step of dt [s]."""

    def __init__(self, problem, unknowns, dt, real=REAL, rng=None):
        """With a random generator `rng`, state and projectors have errors of up to an ulp."""
        super().__init__(problem, real, rng)
        self.dt, self.unknowns = self.real(dt), unknowns
        self.B = unknowns.B.astype(self.real)
        if rng is not None:
            self.bodies = [error_bounds.perturb_body(q, rng) for q in self.bodies]
            self.B = error_bounds.perturb(self.B, rng, np.ones(len(self.B)))
        self.intact = [q._replace(V0=q.V0 * (1 if q.y is None else intact(q.y, q.flow)))
                       for q in self.bodies]
        self.stencils = [pairs(q.x, self.method.dx, self.method.degree) for q in self.bodies]
        box = transfer.box_of(*self.stencils)
        both = list(zip(self.bodies, self.stencils))
        self.m = sum(transfer.mass(q.m, ip, box) for q, ip in both)
        self.mv = sum(transfer.momentum(q.m, q.v, q.C, ip, box) for q, ip in both)
        self.v = self.mv / np.where(self.m > 0, self.m, 1)[..., None]
        self.box = box

    def on_box(self, u):
        """Return a nodal field (n, ..) as an array over the box, 0 at nodes without particles."""
        k = self.unknowns.index - self.box.first
        inside = ((k >= 0) & (k < self.box.shape)).all(axis=1)
        out = np.zeros((*self.box.shape, *u.shape[1:]), self.real)
        out[tuple(k[inside].T)] = u[inside]
        return out

    def on_nodes(self, a):
        """Return the values (n, ..) of an array over the box on the nodes of the unknowns."""
        return values_at(a, self.box, self.unknowns.index)

    def grid_arrays(self, bases=None):
        """Return {key: array} of weights, mass, momentum and velocity.

        Weights are those of the stencils that begin at bases[body name], by default the twin's.
        """
        arrays = {"mass": self.m, "momentum": self.mv, "velocity_old": self.v}
        arrays = {name: self.on_nodes(a) for name, a in arrays.items()}
        for name, ip in zip(self.names, self.stencils):
            base = ip.node[:, 0]
            arrays[f"{name}/weights"] = ip.w if bases is None else align(ip.w, base, bases[name])
        return arrays

    def before_solve(self, bases_and_start, probes, levels):
        """Return {key: array} of all stages before the solve, V-cycle and direction left out.

        bases_and_start has the first nodes of the particles' stencils and the increment that the
        solve starts from, of the kernels; probes are `implicit_recording.ProbeVectors`, and levels
        = (the levels of the kernels' hierarchy, the kernel of their embedding), or None.
        """
        bases, start = bases_and_start
        arrays = self.grid_arrays(bases) | self.conditions() | {"kappa": self.kappa()}
        for name, dv in (("start", start), ("trial", probes.trial)):
            tangents = self.tangents(dv)
            E, g = self.potential(dv)
            arrays |= {f"E_{name}": E, f"gradient_{name}": g,
                       f"product_{name}": self.hessian_product(tangents, probes.probe)}
            if name == "start" and levels is not None:
                arrays |= self.coarse_arrays(tangents, probes.coarse, *levels)
        return arrays

    def coarse_arrays(self, tangents, vectors, levels, kernel):
        """Return {key: array} of prolongations and coarse products, of vectors on coarse nodes."""
        W = [embedding_weights(fine.index, coarse.index, kernel)
             for fine, coarse in pairwise(levels)]
        B = [self.B, *(level.B.astype(self.real) for level in levels[1:])]
        arrays = {}
        for k, u in enumerate(vectors, 1):
            u = u.astype(self.real)
            for l in reversed(range(k)):
                u = prolongate(W[l], B[l], u)
                if l == k - 1:
                    arrays[f"prolonged{k}"] = u
            g = self.hessian_product(tangents, u)
            for l in range(k):
                g = restrict(W[l], B[l], g)
            arrays[f"coarse{k}"] = g
        return arrays

    def conditions(self):
        """Return {key: array} that must follow from the kernels' projectors and increments.

        A projector B is 3 B^2 - 2 B^3, and the increment that conditions prescribe has no free
        part.
        """
        B, dv0 = self.B, self.unknowns.dv0.astype(self.real)
        B2 = np.einsum("nab,nbc->nac", B, B)
        start = dv0 - np.einsum("nab,nb->na", B, dv0)
        return {"projector": 3 * B2 - 2 * np.einsum("nab,nbc->nac", B2, B), "start": start}

    def kappa(self):
        """Return the characteristic norms (n,) [kg m/s] (HOT-eq9)."""
        d = self.gravity.shape[0]
        xi = [rest_stiffness(q.law, d, self.real) for q in self.bodies]
        shares = [transfer.mass(q.m, ip, self.box) for q, ip in zip(self.bodies, self.stencils)]
        m = self.on_nodes(self.m)
        mean = self.on_nodes(sum(x * a for x, a in zip(xi, shares))) / np.where(m > 0, m, 1)
        return mean * 2 * d * (2 * self.method.dx) ** (d - 1) * self.dt

    def potential(self, dv):
        """Return E (1,) [J] and its gradient B g (n, d) [kg m/s] at the increment dv (n, d)."""
        bodies = [(q, ip, self.box) for q, ip in zip(self.intact, self.stencils)]
        E, g = potential.evaluate(bodies, self.m, self.v, self.on_box(dv), self.dt, self.gravity)
        return np.array([E]), self.project(self.on_nodes(g))

    def project(self, u):
        """Return B u."""
        return np.einsum("nab,nb->na", self.B, u)

    def tangents(self, dv):
        """Return the `BodyTangent` of every body at the increment dv (n, d)."""
        v = self.v + self.on_box(dv)
        return [self._tangent(q, ip, v) for q, ip in zip(self.bodies, self.stencils)]

    def _tangent(self, q, ip, u):
        A, F_n = potential.growth(u, self.dt, ip, self.box), as_matrices(q.F, self.gravity.shape[0])
        F = np.einsum("pab,pbc->pac", A, F_n)
        return BodyTangent(F_n, stress_differential(F, q.law))

    def hessian_product(self, tangents, u):
        """Return B H B u (n, d) [kg m/s] of u (n, d), at the increment of the tangents."""
        u = self.on_box(self.project(u))
        total = self.m[..., None] * u
        for q, ip, tangent in zip(self.intact, self.stencils, tangents):
            L = transfer.velocity_gradient(u, ip, self.box)
            dF = np.einsum("pab,pbc->pac", L, tangent.F_n)
            dP = apply_differential(tangent.differential, dF)
            T = np.einsum("pab,pcb->pac", dP, tangent.F_n)
            total -= self.dt**2 * transfer.internal_force(q.V0, T, ip, self.box)
        return self.project(self.on_nodes(total))

    def after_solve(self, v):
        """Return {key: array} of the stages after the solve, for nodal velocities v (n, d).

        The bodies advance.
        """
        arrays = self.arrays(self.advance(v.astype(self.real)), self.unknowns.index)
        return {key: a for key, a in arrays.items()
                if "/" in key and not key.endswith("/weights")}

    def advance(self, v):
        """Return the `plain.step.StepStages` of nodal velocities v (n, d); the bodies advance."""
        grid = Nodes(self.box, self.m, self.mv, 0 * self.mv, self.v, self.on_box(v))
        both = zip(self.bodies, self.stencils)
        motions = [grid_to_particles(q, ip, grid, self.method, self.dt) for q, ip in both]
        motions = [self.clipped(motion) for motion in motions]
        updates = [deform(q, motion.L, self.dt) for q, motion in zip(self.bodies, motions)]
        self.bodies = [new_state(*body) for body in zip(self.bodies, motions, updates)]
        return StepStages(self.stencils, grid, motions, updates, self.dt)


def as_matrices(F, d):
    """Return F (N, d, d); for a fluid's J (N,) the multiple of I with that determinant."""
    if F.ndim == 3:
        return F
    return (F ** (1 / F.dtype.type(d)))[:, None, None] * np.eye(d, dtype=F.dtype)


def rest_stiffness(law, d, real):
    """xi = ||dP/dF||_F at F = I [Pa] (HOT-sec5.2)."""
    s = np.ones((1, d), real)
    A, (a, b) = slopes(s, law), difference_quotients(s, law)
    return np.sqrt((A * A).sum() + (a * a + b * b).sum() / 2)


def embedding_weights(fine, coarse, kernel):
    """W_ic = prod_a N(i_a/2 - c_a) (n, m) (HOT-eq3), exact in floats.

    fine (n, d) and coarse (m, d) are the world indices i, c of the nodes of two levels.
    """
    degree = DEGREE[kernel]
    w = np.ones((len(fine), len(coarse)))
    for i, c in zip(fine.T, coarse.T):
        w *= bspline((i[:, None] - 2 * c) / 2 + (degree + 1) / 2, degree)
    return sp.coo_array(w)


def prolongate(W, B, u):
    """P u (n, d) of u (m, d), with the blocks P_ic = W_ic B_i (HOT-eq4)."""
    out = np.zeros((W.shape[0], *u.shape[1:]), u.dtype)
    np.add.at(out, W.row, W.data[:, None] * u[W.col])
    return np.einsum("nab,nb->na", B, out)


def restrict(W, B, g):
    """R g = P^T g (m, d) of g (n, d) (HOT-eq5)."""
    out = np.zeros((W.shape[1], *g.shape[1:]), g.dtype)
    np.add.at(out, W.col, W.data[:, None] * np.einsum("nab,nb->na", B, g)[W.row])
    return out
