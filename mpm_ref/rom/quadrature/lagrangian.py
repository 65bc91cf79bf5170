"""Lagrangian quadrature: neighbours of the samples carry mass, momentum and stress (LDM-alg3,
LDM-sec3.2.1-sets).

Neighbours are other material points, or (`Resampled`) points of another sampling of the body, as
coarse as the quadrature allows: then the cost of a step does not grow with the number of material
points, and no map is inverted. `Neighbours` are determined once, for all times and parameters
(LDMW-sets). `NumberedPoints` are for fields with values at numbered points alone (NSF-sec5.4).
"""

from typing import NamedTuple

import numpy as np

from ..fields.blocks import Blocks, blocks
from ..kinematics import Kinematics, evaluate
from . import Cloud
from .stencil_overlap import stencil_overlap

CELLS = 2.0         # size of a block [dx]


class Lagrangian(NamedTuple):
    """Material points as quadrature points, with their masses."""

    X: np.ndarray       # (n, d) at rest [m]; of several bodies, numbers (n,)
    m: np.ndarray       # (n,)   mass [kg]
    V0: np.ndarray      # (n,)   volume at rest [m^d]
    blocks: Blocks      # or `BodyBlocks` of several bodies
    dx: float           # of the grid [m]
    degree: int         # of its splines

    feather = 0.0       # samples are quadrature points themselves

    def support(self, g, xhat, samples):
        """Return sorted numbers of the samples and of all points that share a node with one."""
        if len(samples) == len(self.X):
            return samples
        x = g.place(self.X[samples], xhat)
        return np.union1d(self.neighbours(g, xhat, x), samples)

    def neighbours(self, g, xhat, x):
        """Return numbers of all points that share a node with a position x (m, d)."""
        candidates = self.blocks.near(g, xhat, x, (self.degree + 1) * self.dx)
        overlap = stencil_overlap(x, self.dx, self.degree)
        return candidates[overlap.overlaps(g.place(self.X[candidates], xhat))]

    def cloud(self, g, xhat, samples):
        """Return the `Cloud` of a step with these samples."""
        return cloud_of(self, self.support(g, xhat, samples), g, xhat, samples)


def lagrangian(X, m, V0, dx, degree):
    """Return the `Lagrangian` quadrature of a body's material points."""
    return Lagrangian(X, m, V0, blocks(X, CELLS * dx), dx, degree)


def cloud_of(body, chosen, g, xhat, samples):
    """Return the `Cloud` of chosen points of a body with X, m and V0; some of them are samples.
    Both lists of numbers are sorted.
    """
    at = evaluate(g, body.X[chosen], xhat)
    return Cloud(at, body.m[chosen], body.V0[chosen], at.select(np.searchsorted(chosen, samples)),
                 {"points": len(chosen)}, chosen)


class Resampled(NamedTuple):
    """Quadrature by another sampling of the body, whose points carry mass; samples are material
    points.
    """

    X: np.ndarray       # (n, d) material points at rest [m]
    other: Lagrangian

    feather = 1e-9      # no node that samples read is empty

    @property
    def dx(self):
        """Spacing of the grid [m]."""
        return self.other.dx

    @property
    def degree(self):
        """Degree of the grid's splines."""
        return self.other.degree

    def cloud(self, g, xhat, samples):
        """Return the `Cloud` of a step with these samples."""
        X, other = self.X[samples], self.other
        chosen = np.sort(other.neighbours(g, xhat, g.place(X, xhat)))
        return Cloud(evaluate(g, other.X[chosen], xhat), other.m[chosen], other.V0[chosen],
                     evaluate(g, X, xhat), {"points": len(chosen)})


class Neighbours(NamedTuple):
    """Lagrangian quadrature on a fixed set of material points.

    It equals that of `lagrangian`, to the last bit, unless another point comes to share a node with
    a sample. This is not detected, and then the sample's nodes lack the point's mass.
    """

    X: np.ndarray           # (n, d) of all material points, at rest [m]
    m: np.ndarray           # (n,)   mass [kg]
    V0: np.ndarray          # (n,)   volume at rest [m^d]
    dx: float               # of the grid [m]
    degree: int             # of its splines
    samples: np.ndarray     # (s,) numbers of M, sorted
    around: np.ndarray      # (k,) numbers of N, sorted; none is in M

    feather = 0.0           # samples are quadrature points themselves

    def cloud(self, g, xhat, samples):
        """Return the `Cloud` of the points of M and N. Raises ValueError for a sample that is not
        in M.
        """
        foreign = np.setdiff1d(samples, self.samples)
        if len(foreign):
            raise ValueError(f"sample {foreign[0]} is not among the {len(self.samples)} that "
                             "neighbours were found for: sample among those")
        return cloud_of(self, np.union1d(self.samples, self.around), g, xhat, samples)


def neighbours(lagrangian, g, latents, samples):
    """Return the `Neighbours` of samples of a `Lagrangian` quadrature: the points that share a node
    with one at any of the latent coordinates (.., r), such as those of all training snapshots.

    Raises ValueError where there are no latent coordinates.
    """
    samples, latents = np.unique(samples), np.reshape(latents, (-1, g.r))
    if not len(latents):
        raise ValueError("no latent coordinates to find neighbours at: expected those of at least "
                         "one state")
    near = [lagrangian.support(g, xhat, samples) for xhat in latents]
    around = np.setdiff1d(np.unique(np.concatenate(near)), samples)
    return Neighbours(lagrangian.X, lagrangian.m, lagrangian.V0, lagrangian.dx, lagrangian.degree,
                      samples, around)


class NumberedPoints(NamedTuple):
    """Lagrangian quadrature of a field with numbered points, which can search those near a
    place.
    """

    m: np.ndarray           # (n,) mass [kg]
    V0: np.ndarray          # (n,) volume at rest [m^d]
    dx: float               # of the grid [m]
    degree: int             # of its splines

    feather = 0.0           # samples are quadrature points themselves

    def cloud(self, field, xhat, samples):
        """Return the `Cloud` of the integration points N that share a node with a sample
        (NSF-sec5.4), the samples first. F and dg/dxhat are not evaluated.
        """
        points, x = self.integration_points(field, xhat, samples)
        count = len(samples)
        return Cloud(Kinematics(points, x), self.m[points], self.V0[points],
                     Kinematics(samples, x[:count]), {"points": len(points)})

    def integration_points(self, field, xhat, samples):
        """Return numbers (m,) of the points of `cloud` and their positions (m, d) [m]."""
        x = field.place(samples, xhat)
        if len(samples) == len(self.m):
            return samples, x
        candidates = field.near(xhat, x, (self.degree + 1) * self.dx)
        candidates = candidates[~np.isin(candidates, samples)]
        x_candidates = field.place(candidates, xhat)
        near = stencil_overlap(x, self.dx, self.degree).overlaps(x_candidates)
        return (np.concatenate([samples, candidates[near]]),
                np.concatenate([x, x_candidates[near]]))
