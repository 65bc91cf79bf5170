"""Lagrangian quadrature: the samples' own neighbours carry mass, momentum and stress (LDM-alg3,
LDM-sec3.2.1-sets).
"""

from typing import NamedTuple

import numpy as np

from .blocks import Blocks, blocks
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
        candidates = self.blocks.near(map, latent.xhat, x, (self.degree + 1) * self.dx)
        here = map.place(self.X[candidates], latent.xhat)
        near = reach(x, self.dx, self.degree).reached(here)
        return np.union1d(candidates[near], samples)

    def cloud(self, map, latent, samples):
        """X, m and V0 of the quadrature points of a step, and what is to be said of them."""
        chosen = self.support(map, latent, samples)
        return self.X[chosen], self.m[chosen], self.V0[chosen], {"points": len(chosen)}


def lagrangian(X, m, V0, dx, degree):
    """`Lagrangian` quadrature of a body's material points."""
    return Lagrangian(X, m, V0, blocks(X, CELLS * dx), dx, degree)
