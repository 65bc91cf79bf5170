"""Which points share a node with the samples: the nodes I and the cells around them (LDM-alg3).

A point reaches the nodes base .. base + degree on every axis, so two points share a node where
their bases are at most `degree` apart. The bases that are near a sample are marked in a box.
"""

from itertools import product
from typing import NamedTuple

import numpy as np

from ..core.grid import OutOfRange, extent

MOST = 1e9          # bases in a box


class Reach(NamedTuple):
    """Bases that are near a sample."""

    flag: np.ndarray        # (n1, .., nd) bool
    origin: np.ndarray      # (d,) index of the first base
    dx: float               # [m]
    degree: int

    def __contains__(self, x):
        """Whether one point x (d,) [m] shares a node with a sample."""
        return bool(self.reached(np.asarray(x)[None])[0])

    def reached(self, x):
        """Whether each of the points x (n, d) [m] shares a node with a sample."""
        k = bases(x, self.dx, self.degree) - self.origin
        inside = np.all((k >= 0) & (k < self.flag.shape), axis=1)
        return inside & self.flag[tuple(np.where(inside[:, None], k, 0).T)]

    def cells(self):
        """The marked bases (n, d), in order."""
        return np.argwhere(self.flag) + self.origin


def bases(x, dx, degree):
    """First node that each of the points x (n, d) reaches, per axis (see `core.spline`)."""
    return np.floor(x / dx - 0.5 * (degree - 1)).astype(np.int64)


def reach(x, dx, degree):
    """`Reach` of samples x (n, d) [m]. Raises `OutOfRange` where one is not finite, or they are so
    far apart that the box would need more than MOST bases.
    """
    low, high = extent(x)
    if np.prod((high - low) / dx + 2 * degree + 1) > MOST:
        raise OutOfRange(f"samples from {low} to {high} m, {dx} m apart on the grid: have the "
                         "latent coordinates left the range that the map was trained with?")
    base = np.unique(bases(x, dx, degree), axis=0)
    origin = base.min(axis=0) - degree
    shape = base.max(axis=0) + degree + 1 - origin
    flag = np.zeros(shape, dtype=bool)
    for offset in product(range(-degree, degree + 1), repeat=x.shape[1]):
        flag[tuple((base + offset - origin).T)] = True
    return Reach(flag, origin, dx, degree)
