"""Rigid motions of a step: their balance of momentum holds whatever the tolerance of the solve.

Nodes that particles connect move without elastic work along u_i = a + W y_i, with W skew and
y_i = x_i + dt (v_i + dv_i) the positions at the end of the step, since sum_i u_i dw_ip^T changes
F_p by dt W F_p and P F^T is symmetric. So at the minimum of the potential (HOT-eq1)

    sum_i u_i . (m_i (dv_i - dt g) + dD/du_i) = 0

for all of these motions that the conditions admit, with the dissipation D of `friction`. No
stiffness enters, while the tolerance of HOT-eq9 is relative to the stiffness: a solve within it may
lose all weight, or the spin, of a stiff body. `RigidMotions.balanced` adds the rigid motion that
restores the sums.
"""

from itertools import combinations

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

ROUND_OFF = 1e-13       # of the momenta in a sum, below which it counts as zero
DEPENDENT = 1e-10       # share of the largest inertia below which a motion is that of others
ADMITTED = 1e-10        # largest share of a motion that conditions may take from an admitted one
ROUNDS = 12             # of corrections, at most: y depends on dv
FRICTION_ROUNDS = 60    # ... with friction, whose kink shortens corrections
LEAST_SHARE = 1e-9      # of a correction


class RigidMotions:
    """Rigid motions of the connected parts of a step's nodes.

    potential is a `Potential`; unknowns have the conditions (`Unknowns`).
    """

    def __init__(self, potential, unknowns):
        self.unknowns, self.dt, self.weight = unknowns, potential.dt, potential.weight
        self.potential = potential
        label = components(potential.points, unknowns.number, potential.stencil)
        self.order = np.argsort(label, kind="stable")
        self.label = label
        self.first = np.searchsorted(label[self.order], np.arange(label.max(initial=-1) + 1))
        self.mass = self.sums(unknowns.m)

    def sums(self, a):
        """Return the sums (parts, ..) over the nodes of each part of a (n, ..)."""
        return np.add.reduceat(a[self.order], self.first, axis=0)

    def balanced(self, dv):
        """Return dv (n, d) [m/s] plus the rigid motions that balance; dv itself if it does."""
        if not len(dv):
            return dv
        m, kinetic = self.unknowns.m, self.unknowns.v**2 + (self.dt * self.weight) ** 2 / (
            self.unknowns.m[:, None] ** 2)
        for _ in range(ROUNDS if self.potential.friction is None else FRICTION_ROUNDS):
            slack = ROUND_OFF**2 * self.sums((m[:, None] * (kinetic + dv**2)).sum(axis=1))
            R = self.motions(dv)
            Z = self.admitted(R)
            impulse = m[:, None] * dv - self.dt * self.weight
            self.potential.add_friction(dv, impulse)
            r = self.sums(np.einsum("naq,na->nq", R, impulse))
            rho = np.einsum("kqs,kq->ks", Z, r)
            off = (rho**2).sum(axis=1) > slack
            if not off.any():
                return dv
            rho = np.where(off[:, None], rho, 0.0)
            c = np.einsum("kqs,ks->kq", Z, self.corrections(rho, R, Z, dv))
            u = np.einsum("naq,nq->na", R, c[self.label])
            dv = self.advanced(dv, np.einsum("nab,nb->na", self.unknowns.B, u))
        return dv

    def advanced(self, dv, u):
        """Return dv - u, or with friction dv less so much of u that the convex sum of kinetic
        energy, work of gravity and D falls, which the kink of D may forbid the whole of u.
        """
        if self.potential.friction is None:
            return dv - u
        before, share = self.rigid_energy(dv), 1.0
        while share > LEAST_SHARE and not self.rigid_energy(dv - share * u) <= before:
            share *= 0.5
        return dv - share * u

    def rigid_energy(self, dv):
        """Return sum m |dv|^2/2 - dt m g . dv + D [J], all that rigid motions change."""
        impulse = 0.5 * self.unknowns.m[:, None] * dv - self.dt * self.weight
        return float((impulse * dv).sum()) + self.potential.dissipated(dv)

    def corrections(self, rho, R, Z, dv):
        """Return the steps of Newton's method that end the sums rho (parts, q) of motions R Z."""
        if self.potential.friction is None:
            return rho
        node, blocks = self.potential.friction_blocks(dv)
        part, R = self.label[node], R[node]
        H = np.zeros_like(Z)
        np.add.at(H, part, np.einsum("kaq,kab,kbs->kqs", R, blocks, R))
        H = np.einsum("kqs,kqr,krt->kst", Z, H, Z) + np.eye(Z.shape[1])
        return np.linalg.solve(H, rho[:, :, None])[:, :, 0]

    def motions(self, dv):
        """Return translations and rotations (n, d, d (d + 1)/2) of each node's part, without unit:
        rotations about the centre of mass, relative to the radius of gyration.
        """
        q, m = self.unknowns, self.unknowns.m
        y = q.index * q.dx + self.dt * (q.v + dv)
        r = y - (self.sums(m[:, None] * y) / self.mass[:, None])[self.label]
        radius = np.sqrt(self.sums(m * (r**2).sum(axis=1)) / self.mass)
        r = r / np.where(radius > 0.0, radius, 1.0)[self.label, None]
        n, d = r.shape
        pairs = list(combinations(range(d), 2))
        R = np.zeros((n, d, d + len(pairs)))
        R[:, range(d), range(d)] = 1.0
        for k, (a, b) in enumerate(pairs, start=d):
            R[:, a, k], R[:, b, k] = -r[:, b], r[:, a]
        return R

    def admitted(self, R):
        """Return combinations Z (parts, q, q) of motions R, with unit inertia each and independent,
        that the conditions admit; zero columns for those that they do not.
        """
        G = self.sums(np.einsum("n,naq,nas->nqs", self.unknowns.m, R, R))
        inertia, U = np.linalg.eigh(G)
        low = DEPENDENT * inertia[:, -1:]
        scale = np.where(inertia > low, 1.0 / np.sqrt(np.maximum(inertia, low)), 0.0)
        W = U * scale[:, None, :]
        RB = R - np.einsum("nab,nbq->naq", self.unknowns.B, R)
        N = self.sums(np.einsum("naq,nas->nqs", R, RB))
        N = self.mass[:, None, None] * np.einsum("kqs,kqr,krt->kst", W, N, W)
        share, V = np.linalg.eigh(N)
        free = share <= ADMITTED * np.maximum(share[:, -1:], 1.0)
        return np.einsum("kqs,kst->kqt", W, V) * free[:, None, :]


def components(points_of_bodies, number, stencil):
    """Return the part (n,) of each numbered node: nodes are connected by the particles that reach
    them both.

    points_of_bodies are `QuadraturePoints`; number is that of `Unknowns`.
    """
    shape = number.shape
    bases = [np.ravel_multi_index(points.base.T, shape) for points in points_of_bodies]
    base = np.unique(np.concatenate(bases))
    offsets = np.stack(np.meshgrid(*[stencil] * len(shape), indexing="ij"), -1)
    reach = offsets.reshape(-1, len(shape)) @ strides_of(shape)
    ends = (base[:, None] + reach).reshape(-1)
    starts = np.repeat(base, len(reach))
    graph = coo_array((np.ones(len(ends), dtype=np.int8), (starts, ends)),
                      shape=(number.size, number.size))
    label = connected_components(graph, directed=False)[1][number.reshape(-1) >= 0]
    return np.unique(label, return_inverse=True)[1]


def strides_of(shape):
    """Return by how much the flat index of a node of a grid grows along each axis."""
    return np.cumprod((1, *shape[:0:-1]))[::-1]
