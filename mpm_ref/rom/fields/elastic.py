"""Elastic fields: the stress follows from the deformation gradient of the map.

    tau_p = tau(F_p),    F_p = dg/dX

`ElasticMap` makes a field of a deformation map and a law, as LDM has it (LDM-eq15), or of the
`BodyLaws` of several bodies, whose points have numbers; and with rates an affine velocity field,
the gradient of the map's velocity, where a transfer asks for one. LDM itself is printed with PIC,
which has none. `ElasticModes`
does so for the modes of NSF's fields, where F = I + sum_k a_k(xhat) dU_k/dX: it is the model that
NSF is compared with (NSF-X12). Where plasticity has acted, or a body is torn between two points,
that is not the stress of the full model. The gradients of modes are those of the planes that fit
them best at a point's nearest neighbours of the same body.
"""

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.spatial import KDTree

from ...body import Body, particles_at
from ...explicit import initial_stress
from ...materials import NoFlow
from .pod_fields import PodFields

NEIGHBOURS = 26         # of a point, in 3D those of a lattice; in 2D 8
LEAST = 1e-10           # of a spread over the largest: across a plane there is no gradient
SHIFT = 1e-5            # of latent coordinates, over 1 + their length, for the rate of F


class Portion(NamedTuple):
    """The points of one body, and their law."""

    first: int
    last: int           # the number after its last
    law: tuple


class BodyLaws(NamedTuple):
    """The elastic laws of several bodies, whose points have numbers, one body after the other."""

    portions: tuple     # of `Portion`

    def stress(self, points, F):
        """Return the Kirchhoff stress (m, d, d) [Pa] of F (m, d, d) of points by number (m,), each
        by the law of its body.
        """
        tau = np.empty_like(F)
        for one in self.portions:
            inside = (points >= one.first) & (points < one.last)
            tau[inside] = elastic_stress(F[inside], one.law)
        return tau


def body_laws(bodies):
    """Return the `BodyLaws` of a problem's bodies."""
    ends = np.cumsum([0] + [len(body.id) for body in bodies])
    return BodyLaws(tuple(Portion(*pair, body.law)
                          for pair, body in zip(pairwise(ends), bodies, strict=True)))


class ElasticMap(NamedTuple):
    """A deformation map of a body of one law, or of several bodies, with the stress of its F."""

    g: object           # `fields.DeformationMap`, of points at rest; of several bodies, by number
    law: tuple          # the elastic law's parameters (see materials), or `BodyLaws`

    @property
    def dim(self):
        """Number of axes d."""
        return self.g.dim

    @property
    def r(self):
        """Number of latent coordinates."""
        return self.g.r

    def place(self, X, xhat):
        """Return x of points X (n, d) [m]."""
        return self.g.place(X, xhat)

    def derivatives(self, X, xhat):
        """Return x (n, d), F (n, d, d) and dg/dxhat (n, d, r) of points X (n, d)."""
        return self.g.derivatives(X, xhat)

    def velocity(self, X, xhat, vhat):
        """Return dg/dxhat vhat of points X (n, d) [m/s]."""
        return self.g.velocity(X, xhat, vhat)

    def velocity_gradient(self, X, xhat, vhat):
        """Return dv/dx = F' F^-1 (n, d, d) [1/s] of points X (n, d) at rest, for the velocity
        v = dg/dxhat vhat (LDM-eq16) at coordinates xhat (r,) with rates vhat (r,) [1/s]; F' is the
        rate of F along vhat, by central differences. Ours, for APIC and MLS-MPM.
        """
        F = self.g.derivatives(X, xhat)[1]
        if not np.any(vhat):
            return np.zeros_like(F)
        h = SHIFT * (1.0 + np.linalg.norm(xhat)) / np.linalg.norm(vhat)
        rate = (self.g.derivatives(X, xhat + h * vhat)[1]
                - self.g.derivatives(X, xhat - h * vhat)[1]) / (2.0 * h)
        return rate @ np.linalg.inv(F)

    def stress(self, X, xhat, F=None):
        """Return the Kirchhoff stress (n, d, d) [Pa] of F (n, d, d), if given, or of the map's."""
        F = self.g.derivatives(X, xhat)[1] if F is None else F
        if isinstance(self.law, BodyLaws):
            return self.law.stress(X, F)
        return elastic_stress(F, self.law)


class ElasticModes(NamedTuple):
    """The modes of a map with the stress of its deformation gradient, for the points of bodies."""

    fields: PodFields
    D: np.ndarray       # (n, d, d, R) dU/dX of modes [1/m]
    laws: BodyLaws

    @property
    def X(self):
        """Points (n, d) at rest [m]."""
        return self.fields.X

    @property
    def dim(self):
        """Number of axes d."""
        return self.fields.dim

    @property
    def r(self):
        """Number of latent coordinates."""
        return self.fields.r

    def place(self, points, xhat):
        """Return x (m, d) [m] of points of these numbers."""
        return self.fields.place(points, xhat)

    def derivatives(self, points, xhat):
        """Return x (m, d), F (m, d, d) and dg/dxhat (m, d, r)."""
        x, _, G = self.fields.derivatives(points, xhat)
        return x, self.F(points, xhat), G

    def F(self, points, xhat):
        """Return the deformation gradients (m, d, d) of the map."""
        return np.eye(self.dim) + self.D[points] @ self.fields.all(xhat)

    def stress(self, points, xhat, F=None):
        """Return the Kirchhoff stress (m, d, d) [Pa] of F (m, d, d), if given, or of the map's."""
        return self.laws.stress(points, self.F(points, xhat) if F is None else F)

    def affine(self, points, xhat):
        """Return C (m, d, d) [1/s], which is 0: there is no affine field."""
        return np.zeros((len(points), self.dim, self.dim))

    def near(self, xhat, x, distance):
        """Return numbers of all points that may be within a distance [m], by the largest axis, of
        one of the positions x (m, d).
        """
        return self.fields.near(xhat, x, distance)


def elastic_stress(F, law):
    """Return the Kirchhoff stress (m, d, d) [Pa] of deformation gradients (m, d, d), without
    plasticity.
    """
    m, d = F.shape[:2]
    particles = particles_at(np.zeros((m, d)), np.zeros((m, d)), np.ones(m), np.ones(m), "pic")
    particles.F[:] = F
    initial_stress(Body("deformed", particles, law, NoFlow(), np.arange(m)))
    return particles.tau


def elastic_modes(fields, bodies):
    """Return the `ElasticModes` of `PodFields` whose points are those of a problem's bodies, in
    order. Raises ValueError for a body with too few points for a gradient.
    """
    for body in bodies:
        require_neighbours(body.name, len(body.id), fields.dim)
    laws = body_laws(bodies)
    D = [gradients(fields.X[p.first:p.last], fields.U[p.first:p.last]) for p in laws.portions]
    return ElasticModes(fields, np.concatenate(D), laws)


def require_neighbours(name, n, d):
    """Raise ValueError unless a body of n points in d dimensions has neighbours along all axes."""
    if n <= d:
        raise ValueError(f"points in the body {name!r}: {n}, too few for a gradient of the map: "
                         f"expected at least {d + 1}; sample the body more finely, or take fields "
                         "with a stress of their own")


def gradients(X, U):
    """Return dU/dX (n, d, d, R), by component and axis, of modes U (n, d, R) at points X (n, d).

    They are the slopes of planes through each point that fit its neighbours by least squares,
    nearer ones counting more; n > d.
    """
    n, d = X.shape
    away, near = KDTree(X).query(X, min(n, 1 + (NEIGHBOURS if d == 3 else 8)))
    arms = X[near] - X[:, None]
    w = 1.0 / np.maximum(away, away[:, -1:] * 1e-3) ** 2
    w[:, 0] = 0.0
    spread = np.einsum("nk,nki,nkj->nij", w, arms, arms)
    slope = (w[:, :, None] * arms) @ np.linalg.pinv(spread, rcond=LEAST, hermitian=True)
    D = np.zeros((n, d, d, U.shape[2]))
    for k in range(1, near.shape[1]):
        D += (U[near[:, k]] - U)[:, :, None] * slope[:, k, None, :, None]
    return D
