"""Affine deformations as an exact manifold: x = A X + b with all entries of A and b as latent
coordinates. A reduced run on it equals the full-order run wherever that one stays affine.
"""

from typing import NamedTuple

import numpy as np


class Affine(NamedTuple):
    """The map of all affine deformations; xhat is the rows (A_a, b_a), axis by axis."""

    dim: int

    @property
    def r(self):
        """Number of latent coordinates, d (d + 1)."""
        return self.dim * (self.dim + 1)

    @property
    def rest(self):
        """Latent coordinates of the identity."""
        return np.hstack([np.eye(self.dim), np.zeros((self.dim, 1))]).ravel()

    def place(self, X, xhat):
        """Return x = A X + b."""
        A, b = self._parts(xhat)
        return X @ A.T + b

    def derivatives(self, X, xhat):
        """Return x, F = A, and dg/dxhat, in which axis a depends on row a alone."""
        A, b = self._parts(xhat)
        n, d = X.shape
        G = np.zeros((n, d, d, d + 1))
        for a in range(d):
            G[:, a, a, :d] = X
            G[:, a, a, d] = 1.0
        return X @ A.T + b, np.tile(A, (n, 1, 1)), G.reshape(n, d, self.r)

    def velocity(self, X, xhat, vhat):
        """Return A' X + b' with the rates of A and b."""
        return self.place(X, vhat)

    def _parts(self, xhat):
        rows = np.asarray(xhat).reshape(self.dim, self.dim + 1)
        return rows[:, :-1], rows[:, -1]
