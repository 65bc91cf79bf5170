"""Errors of reduced runs, compared with the full-order runs (LDM-err).

Errors are over all runs, time levels (the start included) and points: || x - x' || over
|| x' ||, measured from the scene's origin, which is the centre of the end that is held; from the
centroid of the body at rest, the strictest choice; and over the displacement || x' - X ||, which
depends on no origin (LDM-X10).
"""

from typing import NamedTuple

import numpy as np

MEASURED = 1000     # points at most, evenly among a body's, of which the misfit is measured


class PositionErrors(NamedTuple):
    """Accumulated errors of the position, as shares."""

    origin: float           # of the distance from the scene's origin
    centroid: float         # of the distance from the body's centroid at rest
    displacement: float     # of the displacement


class Squares:
    """Sums of squares, from which `PositionErrors` are computed."""

    def __init__(self, X):
        self.X, self.sums = X, np.zeros(4)

    def add(self, x, reference):
        """Add one state x (n, d), compared with the full model's."""
        X = self.X
        for k, a in enumerate((x - reference, reference, reference - X.mean(axis=0),
                               reference - X)):
            self.sums[k] += np.sum(a**2)

    @property
    def errors(self):
        """The `PositionErrors` of all states added."""
        return PositionErrors(*(float(np.sqrt(self.sums[0] / s)) for s in self.sums[1:]))


def misfit(field, points, data, xhat):
    """Return the `PositionErrors` of a field's positions at latent coordinates xhat (s, k + 1, r)
    compared with the `Snapshots` or `Histories` of these runs, at MEASURED of its points (n, ..).
    """
    n, d = data.X.shape
    part = slice(None, None, -(-n // MEASURED))
    squares, points = Squares(data.X[part]), points[part]
    for y, x in zip(np.reshape(xhat, (-1, field.r)), data.x.reshape(-1, n, d), strict=True):
        squares.add(field.place(points, y), x[part])
    return squares.errors
