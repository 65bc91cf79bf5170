"""Lagrangian quadrature: the samples' own neighbours carry mass, momentum and stress (LDM-alg3,
LDM-sec3.2.1-sets). Neighbours are other material points, or (`Resampled`) points of another
sampling of the body, as coarse as the quadrature allows: then a step's cost does not grow with the
number of material points, and no map needs to be inverted.
"""

from typing import NamedTuple

import numpy as np

from ..fields.blocks import Blocks, blocks
from ..latent import at_start
from . import carried
from .stencil_overlap import reach

CELLS = 2.0         # size of a block [dx]


class Lagrangian(NamedTuple):
    """Material points as quadrature points, with their masses."""

    X: np.ndarray       # (n, d) at rest [m]
    m: np.ndarray       # (n,)   mass [kg]
    V0: np.ndarray      # (n,)   volume at rest [m^d]
    blocks: Blocks
    dx: float           # of the grid [m]
    degree: int         # of its splines

    feather = 0.0       # mass of a sample on the grid beyond its own

    def support(self, map, latent, samples):
        """Sorted indices of the samples and of all points that share a node with one."""
        if len(samples) == len(self.X):
            return samples
        x = map.place(self.X[samples], latent.xhat)
        return np.union1d(self.neighbours(map, latent.xhat, x), samples)

    def neighbours(self, map, xhat, x):
        """Indices of all points that share a node with a position x (m, d)."""
        candidates = self.blocks.near(map, xhat, x, (self.degree + 1) * self.dx)
        here = map.place(self.X[candidates], xhat)
        return candidates[reach(x, self.dx, self.degree).reached(here)]

    def cloud(self, map, latent, samples):
        """`Cloud` of a step with these samples."""
        return carried(self, self.support(map, latent, samples), map, latent.xhat, samples)


class Resampled(NamedTuple):
    """Samples are material points; what carries mass is another sampling of the body."""

    X: np.ndarray       # (n, d) material points at rest [m]
    other: Lagrangian

    feather = 1e-9      # mass of a sample on the grid over that of a point: no node that samples
                        # read is empty

    @property
    def dx(self):
        """Spacing of the grid [m]."""
        return self.other.dx

    @property
    def degree(self):
        """Of the grid's splines."""
        return self.other.degree

    def cloud(self, map, latent, samples):
        """`Cloud` of a step with these samples."""
        x = map.place(self.X[samples], latent.xhat)
        chosen = np.sort(self.other.neighbours(map, latent.xhat, x))
        return carried(self.other, chosen, map, latent.xhat)


def lagrangian(X, m, V0, dx, degree):
    """`Lagrangian` quadrature of a body's material points."""
    return Lagrangian(X, m, V0, blocks(X, CELLS * dx), dx, degree)


class Neighbours(NamedTuple):
    """Lagrangian quadrature on a set of material points that does not change.

    It is that of `lagrangian`, to the last bit, as long as no other point comes to share a node
    with a sample: nothing tells when one does, and then the sample's nodes lack its mass.
    """

    X: np.ndarray           # (n, d) of all material points, at rest [m]
    m: np.ndarray           # (n,)   mass [kg]
    V0: np.ndarray          # (n,)   volume at rest [m^d]
    dx: float               # of the grid [m]
    degree: int             # of its splines
    samples: np.ndarray     # (s,) indices of M, sorted
    around: np.ndarray      # (k,) indices of N, sorted; none is in M

    feather = 0.0           # mass of a sample on the grid beyond its own

    def cloud(self, map, latent, samples):
        """`Cloud` of the points of M and N. Raises ValueError for a sample that is not in M."""
        foreign = np.setdiff1d(samples, self.samples)
        if len(foreign):
            raise ValueError(f"sample {foreign[0]} is not among the {len(self.samples)} that "
                             "neighbours were found for: sample among those")
        chosen = np.union1d(self.samples, self.around)
        return carried(self, chosen, map, latent.xhat, samples)


def neighbours(lagrangian, map, latents, samples):
    """`Neighbours` of samples of a `Lagrangian` quadrature: the points that share a node with one
    at any of the latent coordinates (.., r), such as those of all training snapshots.

    Raises ValueError where there are no latent coordinates.
    """
    samples, latents = np.unique(samples), np.reshape(latents, (-1, map.r))
    if not len(latents):
        raise ValueError("no latent coordinates to find neighbours at: expected those of at least "
                         "one state")
    near = [lagrangian.support(map, at_start(xhat), samples) for xhat in latents]
    around = np.setdiff1d(np.unique(np.concatenate(near)), samples)
    return Neighbours(lagrangian.X, lagrangian.m, lagrangian.V0, lagrangian.dx, lagrangian.degree,
                      samples, around)
