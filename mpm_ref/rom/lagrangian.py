"""Lagrangian quadrature: the samples' own neighbours carry mass, momentum and stress (LDM-alg3,
LDM-sec3.2.1-sets). Neighbours are other material points, or (`Resampled`) points of another
sampling of the body, as coarse as the quadrature allows: then a step's cost does not grow with the
number of material points, and no map needs to be inverted.
"""

from typing import NamedTuple

import numpy as np

from .blocks import Blocks, blocks
from .placed import carried
from .reach import reach

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
