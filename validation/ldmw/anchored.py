"""A map that is the identity at rest, as the initial condition of LDM-eq17 has it.

A learned map is it only nearly. What it lacks at rest is added to each of its states, as the public
online code of the method can do ("exact_ini"); F has the gradient of that. dg/dxhat is unchanged.
"""

from typing import NamedTuple

import numpy as np


class Anchored(NamedTuple):
    """The map g(X; xhat) + X - g(X; rest)."""

    g: object           # a map
    rest: np.ndarray    # (r,) latent coordinates at rest

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
        return self.g.place(X, xhat) + (X - self.g.place(X, self.rest))

    def derivatives(self, X, xhat):
        """Return x (n, d), F (n, d, d) and dg/dxhat (n, d, r) [m] of points X (n, d)."""
        x, F, G = self.g.derivatives(X, xhat)
        x_rest, F_rest, _ = self.g.derivatives(X, self.rest)
        return x + (X - x_rest), F + (np.eye(self.dim) - F_rest), G

    def velocity(self, X, xhat, vhat):
        """Return dg/dxhat(X; xhat) vhat of points X (n, d) [m/s]."""
        return self.g.velocity(X, xhat, vhat)
