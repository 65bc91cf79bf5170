"""Errors of reduced runs beside the full-order runs (LDM-err).

Errors are over all runs, time levels (the start included) and points: || x - x' || over
|| x' ||, measured from the scene's origin, which is the centre of the end that is held; from the
centroid of the body at rest, the strictest choice; and over the displacement || x' - X ||, which
depends on no origin (LDM-X10).
"""

from typing import NamedTuple

import numpy as np

MEASURED = 1000     # points at most, evenly among a body's, that tell how far a map is off its data


class Errors(NamedTuple):
    """Accumulated errors of the position, as shares."""

    origin: float           # of the distance from the scene's origin
    centroid: float         # of the distance from the body's centroid at rest
    displacement: float     # of the displacement


class Squares:
    """Sums of squares that `Errors` are made of."""

    def __init__(self, X):
        self.X, self.sums = X, np.zeros(4)

    def add(self, x, reference):
        """Add one state x (n, d) beside the full model's."""
        X = self.X
        for k, a in enumerate((x - reference, reference, reference - X.mean(axis=0),
                               reference - X)):
            self.sums[k] += np.sum(a**2)

    @property
    def errors(self):
        """`Errors` of all states added."""
        return Errors(*(float(np.sqrt(self.sums[0] / s)) for s in self.sums[1:]))


def misfit(map, snapshots, xhat):
    """`Errors` of a map's states at latent coordinates xhat (s, k + 1, r) beside the `Snapshots` of
    these runs, at MEASURED points.
    """
    some = slice(None, None, -(-len(snapshots.X) // MEASURED))
    squares = Squares(snapshots.X[some])
    for y, x in zip(np.reshape(xhat, (-1, map.r)), snapshots.flat()[0], strict=True):
        squares.add(map.place(squares.X, y), x[some])
    return squares.errors
