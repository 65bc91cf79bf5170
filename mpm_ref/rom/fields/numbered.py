"""POD modes whose points are numbers instead of places at rest.

A run that evaluates modes at the points of their data alone needs no search for them. Maps of
several bodies need numbers: points of two bodies may have one place at rest, or be neighbours
across a gap; their number says which body they are of. Values are those of the data alone: nothing
is fitted between points, so that no body reads another's modes.
"""

from typing import NamedTuple

import numpy as np

from .pod import PodModes
from .polynomial_manifold import Curved


class NumberedModes(NamedTuple):
    """A linear map by POD modes, known at the numbered points of its data alone."""

    X: np.ndarray       # (n, d)        points at rest [m]
    U: np.ndarray       # (n, d, r)     modes [m]
    slope: np.ndarray   # (n, d, d, r)  their gradients d U_a / d X_b

    @property
    def dim(self):
        """Number of axes d."""
        return self.X.shape[1]

    @property
    def r(self):
        """Number of latent coordinates."""
        return self.U.shape[2]

    def place(self, points, xhat):
        """Return x (m, d) [m] of points of these numbers."""
        return self.X[points] + self.U[points] @ xhat

    def derivatives(self, points, xhat):
        """Return x (m, d), F (m, d, d) and the modes of points of these numbers."""
        U = self.U[points]
        return self.X[points] + U @ xhat, np.eye(self.dim) + self.slope[points] @ xhat, U

    def velocity(self, points, xhat, vhat):
        """Return the velocities (m, d) [m/s] of points of these numbers."""
        return self.U[points] @ vhat


def is_numbered(g):
    """Return whether a map takes numbers of points."""
    return isinstance(g.modes if isinstance(g, Curved) else g, NumberedModes)


def numbered(g):
    """Return `PodModes`, or a `Curved` map of such, with numbers as points. Raises ValueError for
    any other map.
    """
    if isinstance(g, Curved):
        return g._replace(modes=numbered(g.modes))
    if not isinstance(g, PodModes):
        raise ValueError(f"a map of the type {type(g).__name__} for several bodies: expected POD "
                         "modes or a curved map, whose points have numbers")
    return NumberedModes(g.X, g.U, g.slope)
