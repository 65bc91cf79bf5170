"""Sample Poisson-disk points in a box, no two nearer than r, by dart throwing [Bridson2007].

Points lie in a background lattice of cells of edge r/sqrt(d), which hold one point at most, so that
a new dart is compared with the points of few cells. The result depends on the generator alone.
"""

from itertools import product
from math import floor, sqrt
from typing import NamedTuple

import numpy as np

from ..core.jit import kernel
from ..core.tensor import dot, lin, put_vec, vec

ATTEMPTS = 30               # darts around a point before it is given up [Bridson2007]
PAD = 2                     # cells on each side of the box, so that no neighbour is out of range
MAX_CELLS = 100_000_000     # of the background, 4 bytes each


class Background(NamedTuple):
    """Cells over the box [0, span]; `point` is the index of a cell's point, or -1."""

    point: np.ndarray       # (cells,)  int32
    strides: np.ndarray     # (d,)      cells per step along an axis
    near: np.ndarray        # (k,)      offsets to cells that can hold a point nearer than r
    span: np.ndarray        # (d,)      edges of the box [m]
    edge: float             # of a cell [m]
    r: float                # smallest distance [m]


def poisson_disk(low, high, r, rng):
    """Return points (N, d) in the box [low, high] with distances >= r, by the NumPy generator rng.

    Raises ValueError where r is not positive or too small for the box.
    """
    low, high = np.asarray(low, dtype=float), np.asarray(high, dtype=float)
    if not r > 0.0:
        raise ValueError(f"radius = {r}: expected a distance > 0")
    back = background(high - low, r)
    points = np.empty((_most_points(back), len(low)))
    active = np.empty(len(points), dtype=np.int64)
    n = _throw(rng, points, active, back, tuple(range(len(low))))
    return points[:n] + low


def background(span, r):
    """Return empty `Background` cells for the box [0, span] and the distance r."""
    edge = r / sqrt(len(span))
    cells = np.floor(span / edge) + 1 + 2 * PAD
    if np.prod(cells) > MAX_CELLS:
        raise ValueError(f"radius = {r:.3g}: would need {np.prod(cells):.1e} cells, the limit is "
                         f"{MAX_CELLS:.0e}; take a larger radius")
    cells = cells.astype(np.int64)
    strides = np.append(np.cumprod(cells[:0:-1])[::-1], 1).astype(np.int64)
    point = np.full(np.prod(cells), -1, dtype=np.int32)
    return Background(point, strides, _near(len(span)) @ strides, span, edge, r)


def _near(d):
    """Return offsets (k, d) of cells nearer than r = edge sqrt(d) to a cell, nearest first."""
    offsets = np.array(list(product(range(-PAD, PAD + 1), repeat=d)))
    gap2 = (np.maximum(np.abs(offsets) - 1, 0) ** 2).sum(axis=1)
    offsets = offsets[gap2 < d]
    return offsets[np.argsort((offsets**2).sum(axis=1), kind="stable")]


def _most_points(back):
    """Return a bound of the number of points.

    Balls of diameter r cannot be packed denser than sqrt(2)/r^3, disks 2/sqrt(3)/r^2.
    """
    return int(sqrt(2.0) * np.prod(back.span / back.r + 1.0)) + 1


@kernel
def _throw(rng, points, active, back, like):
    """Fill `points` and return their number; `active` are points that may have room around them."""
    n = _add(_anywhere(rng, back.span, like), points, 0, active, 0, back)
    alive = n
    while alive > 0:
        a = floor(rng.random() * alive)
        x = vec(points, active[a], like)
        accepted = False
        for _ in range(ATTEMPTS):
            y = lin(1.0, x, 1.0, _around(rng, back.r, like))
            if _is_free(y, points, back):
                n = _add(y, points, n, active, alive, back)
                alive += 1
                accepted = True
                break
        if not accepted:
            alive -= 1
            active[a] = active[alive]
    return n


@kernel
def _add(x, points, n, active, alive, back):
    """Store x as the active point n and return n + 1."""
    put_vec(points, n, x)
    back.point[_cell(x, back)] = n
    active[alive] = n
    return n + 1


@kernel
def _anywhere(rng, span, like):
    """Return a uniform point of the box."""
    if len(like) == 2:
        return rng.random() * span[0], rng.random() * span[1]
    else:
        return rng.random() * span[0], rng.random() * span[1], rng.random() * span[2]


@kernel
def _in_cube(rng, like):
    """Return a uniform point of [-1, 1]^d."""
    if len(like) == 2:
        return 2.0 * rng.random() - 1.0, 2.0 * rng.random() - 1.0
    else:
        return 2.0 * rng.random() - 1.0, 2.0 * rng.random() - 1.0, 2.0 * rng.random() - 1.0


@kernel
def _around(rng, r, like):
    """Return a uniform point of the shell r <= |y| <= 2r, by rejection."""
    y = _in_cube(rng, like)
    while dot(y, y) > 1.0 or dot(y, y) < 0.25:
        y = _in_cube(rng, like)
    return lin(2.0 * r, y, 0.0, y)


@kernel
def _cell(x, back):
    """Return the index of the cell of x."""
    c = 0
    for a in range(len(x)):
        c += (floor(x[a] / back.edge) + PAD) * back.strides[a]
    return c


@kernel
def _is_free(x, points, back):
    """Return whether x lies in the box, at least r from all points."""
    for a in range(len(x)):
        if not 0.0 <= x[a] <= back.span[a]:
            return False
    c = _cell(x, back)
    for offset in back.near:
        q = back.point[c + offset]
        if q >= 0:
            r = lin(1.0, x, -1.0, vec(points, q, x))
            if dot(r, r) < back.r * back.r:
                return False
    return True
