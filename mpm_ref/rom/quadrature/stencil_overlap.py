"""Search for the points that share a node with the samples (the nodes I of LDM-alg3).

The nodes of a point are base .. base + degree on every axis, so that two points share a node if
their bases differ by at most `degree`. The bases that are so near a sample are flagged in a box.
"""

from itertools import product
from typing import NamedTuple

import numpy as np

from ...core.grid import OutOfRange, extent
from ...core.jit import CHUNKS, chunk, kernel, parallel, prange

MOST = 1e9          # bases in a box


class StencilOverlap(NamedTuple):
    """The bases whose stencils share a node with one of the samples'."""

    flag: np.ndarray        # (n1, .., nd) bool
    origin: np.ndarray      # (d,) index of the first base
    dx: float               # [m]
    degree: int

    def __contains__(self, x):
        """Return whether one point x (d,) [m] shares a node with a sample."""
        return bool(self.overlaps(np.asarray(x)[None])[0])

    def overlaps(self, x):
        """Return whether each of the points x (n, d) [m] shares a node with a sample, as (n,)."""
        flagged = np.empty(len(x), dtype=bool)
        _look_up(Flags(self.flag.ravel(), np.array(self.flag.shape), self.origin, self.dx,
                       0.5 * (self.degree - 1)), x, flagged)
        return flagged

    def cells(self):
        """Return the flagged bases (n, d), in order."""
        return np.argwhere(self.flag) + self.origin


def bases(x, dx, degree):
    """Return the first node of each of the points x (n, d), per axis (see `core.spline`)."""
    return np.floor(x / dx - 0.5 * (degree - 1)).astype(np.int64)


def stencil_overlap(x, dx, degree):
    """Return the `StencilOverlap` of samples x (n, d) [m]. Raises `OutOfRange` where one is not
    finite, or they are so far apart that the box would need more than MOST bases.
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
    return StencilOverlap(flag.reshape(shape), origin, dx, degree)


class Flags(NamedTuple):
    """`StencilOverlap` for kernels."""

    flag: np.ndarray        # (n1 .. nd,) bool
    shape: np.ndarray       # (d,)
    origin: np.ndarray      # (d,)
    dx: float               # [m]
    shift: float            # of a base from its point, in cells


@parallel
def _look_up(box, x, flagged):
    for c in prange(CHUNKS):
        look_up(box, x, flagged, chunk(c, len(x)))


@kernel
def look_up(box, x, flagged, bounds):
    """Look up whether the bases of points bounds[0] .. bounds[1] - 1 are flagged; out of the box
    they are not.
    """
    for i in range(bounds[0], bounds[1]):
        at, inside = 0, True
        for a in range(len(box.shape)):
            k = np.floor(x[i, a] / box.dx - box.shift) - box.origin[a]
            inside = inside and 0 <= k < box.shape[a]
            at = at * box.shape[a] + (np.int64(k) if inside else 0)
        flagged[i] = inside and box.flag[at]
