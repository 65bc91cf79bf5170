"""Which points share a node with the samples: the nodes I and the cells around them (LDM-alg3).

A point reaches the nodes base .. base + degree on every axis, so two points share a node where
their bases are at most `degree` apart. The bases that are near a sample are marked in a box.
"""

from itertools import product
from typing import NamedTuple

import numpy as np

from ...core.grid import OutOfRange, extent
from ...core.jit import CHUNKS, chunk, kernel, parallel, prange

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
        found = np.empty(len(x), dtype=bool)
        _look_up(Flags(self.flag.ravel(), np.array(self.flag.shape), self.origin, self.dx,
                       0.5 * (self.degree - 1)), x, found)
        return found

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
    base = bases(x, dx, degree)
    origin = base.min(axis=0) - degree
    shape = base.max(axis=0) + degree + 1 - origin
    flag = np.zeros(np.prod(shape), dtype=bool)
    strides = np.append(np.cumprod(shape[:0:-1])[::-1], 1)
    offsets = np.array([*product(range(-degree, degree + 1), repeat=x.shape[1])])
    flag[np.add.outer((base - origin) @ strides, offsets @ strides)] = True
    return Reach(flag.reshape(shape), origin, dx, degree)


class Flags(NamedTuple):
    """`Reach` for kernels."""

    flag: np.ndarray        # (n1 .. nd,) bool
    shape: np.ndarray       # (d,)
    origin: np.ndarray      # (d,)
    dx: float               # [m]
    shift: float            # of a base from its point, in cells


@parallel
def _look_up(box, x, found):
    for c in prange(CHUNKS):
        look_up(box, x, found, chunk(c, len(x)))


@kernel
def look_up(box, x, found, bounds):
    """Whether the bases of some points are flagged; those out of the box are not."""
    for i in range(bounds[0], bounds[1]):
        at, inside = 0, True
        for a in range(len(box.shape)):
            k = np.floor(x[i, a] / box.dx - box.shift) - box.origin[a]
            inside = inside and 0 <= k < box.shape[a]
            at = at * box.shape[a] + (np.int64(k) if inside else 0)
        found[i] = inside and box.flag[at]
