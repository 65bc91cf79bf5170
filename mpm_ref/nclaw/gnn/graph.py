"""Who is near whom: the edges of a graph of points [GNS].

Each point is a neighbour of itself as well, as in the release of [GNS], so that none is without.
"""

from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

MOST = 1_000_000        # edges: those of 1000 points in one place


class Lost(ValueError):
    """Points that no run goes on from: one has no finite place, or too many are in one place."""


class Graph(NamedTuple):
    """Edges of n points, sorted by receiver, then by sender."""

    senders: np.ndarray     # (k,)
    receivers: np.ndarray   # (k,)

    @property
    def first(self):
        """The first edge of each receiver (n,)."""
        return np.flatnonzero(np.diff(self.receivers, prepend=-1))


def near(x, radius):
    """`Graph` of points x (n, d) [m] that are at most a radius [m] apart.

    Raises `Lost` for more than MOST edges.
    """
    tree = cKDTree(x)
    count = int(tree.count_neighbors(tree, radius))
    if count > MOST:
        raise Lost(f"{len(x)} points with {count} edges within {radius} m: expected at most "
                   f"{MOST}; take fewer points, or a simulator of a smaller radius")
    pairs, itself = tree.query_pairs(radius, output_type="ndarray"), np.arange(len(x))
    senders = np.concatenate([pairs[:, 0], pairs[:, 1], itself])
    receivers = np.concatenate([pairs[:, 1], pairs[:, 0], itself])
    order = np.lexsort((senders, receivers))
    return Graph(senders[order], receivers[order])
