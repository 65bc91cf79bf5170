"""Material points in blocks of the body at rest, for the search of points near the samples.

In motion, a block's points lie within L radius of its centre's image, where L bounds the stretch.
So the points that can be near a sample follow from one evaluation of the map for each block,
whatever the number of points. If there are many blocks, their centres are points in larger blocks
again. Blocks of several bodies have points of one body each.
"""

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.spatial import KDTree

SAFETY = 1.5        # on the largest stretch at the centres, as a bound on that in between
MANY = 500          # blocks, above which their centres are in larger ones ...
LARGER = 3.0        # ... of this many times the size


class Blocks(NamedTuple):
    """Points by block: those of block k are order[start[k] : start[k + 1]]."""

    order: np.ndarray       # (n,)
    start: np.ndarray       # (blocks + 1,)
    center: np.ndarray      # (blocks, d) of the blocks' points, at rest [m]; of several bodies,
                            # numbers (blocks,) of the points nearest to it
    radius: np.ndarray      # (blocks,) largest distance of a block's point from it [m]
    above: object           # `Blocks` of the centres, or None

    def near(self, g, xhat, x, distance, margin=0.0):
        """Return indices of all points that may be within a distance [m], by the largest axis, of
        one of the positions x (m, d); or that have points within a margin [m] at rest which may be.
        """
        k = np.arange(len(self.center))
        if self.above is not None:
            k = self.above.near(g, xhat, x, distance, margin + self.radius.max())
        x_center, F, _ = g.derivatives(self.center[k], xhat)
        stretch = SAFETY * np.linalg.norm(F, 2, axis=(1, 2)).max(initial=0.0)
        gap, _ = KDTree(x).query(x_center, p=np.inf)
        near = k[gap <= distance + stretch * (self.radius[k] + margin)]
        return points_of_blocks(self.order, self.start, near)


def blocks(X, size):
    """Return the `Blocks` of cubes of a size [m] of points X (n, d) at rest."""
    order, start, center, distance = group(X, size)
    radius = np.maximum.reduceat(distance[order], start[:-1])
    above = blocks(center, LARGER * size) if len(center) > MANY else None
    return Blocks(order, start, center, radius, above)


class BodyBlocks(NamedTuple):
    """The `Blocks` of several bodies, whose points have numbers, one body after the other."""

    blocks: tuple

    def near(self, g, xhat, x, distance):
        """Return numbers of all points that may be within a distance [m] (see `Blocks.near`)."""
        return np.concatenate([one.near(g, xhat, x, distance) for one in self.blocks])


def body_blocks(X, sizes, size):
    """Return the `BodyBlocks` of cubes of a size [m] of points X (n, d) at rest, of bodies with
    these numbers of points.
    """
    ends = np.cumsum([0, *sizes])
    parts = [numbered_blocks(X[first:last], size, np.arange(first, last))
             for first, last in pairwise(ends)]
    return BodyBlocks(tuple(one._replace(order=first + one.order)
                            for first, one in zip(ends, parts, strict=False)))


def numbered_blocks(X, size, numbers):
    """Return the `Blocks` of a body's points X (n, d) at rest, whose centres are those of the
    `numbers` (n,) of its points that are nearest to them.
    """
    order, start, center, _ = group(X, size)
    near = KDTree(X).query(center)[1]
    away = np.linalg.norm(X[order] - np.repeat(X[near], np.diff(start), axis=0), axis=1)
    radius = np.maximum.reduceat(away, start[:-1])
    above = (numbered_blocks(X[near], LARGER * size, numbers[near]) if len(center) > MANY
             else None)
    return Blocks(order, start, numbers[near], radius, above)


def group(X, size):
    """Group points X (n, d) by cubes of a size [m].

    Returns order (n,) and start (blocks + 1,) as in `Blocks`, the centre (blocks, d) of each
    block's points, and the distance (n,) of each point from its block's centre.
    """
    _, block = np.unique(np.floor(X / size).astype(np.int64), axis=0, return_inverse=True)
    count = np.bincount(block)
    order = np.argsort(block, kind="stable")
    start = np.concatenate(([0], np.cumsum(count)))
    center = np.stack([np.bincount(block, X[:, a]) / count for a in range(X.shape[1])], axis=1)
    return order, start, center, np.linalg.norm(X - center[block], axis=1)


def points_of_blocks(order, start, chosen):
    """Return the points of the chosen blocks, in their order; order and start as in `Blocks`."""
    return np.concatenate([order[:0], *(order[start[k]:start[k + 1]] for k in chosen)])
