"""Nodes embedded in the next coarser lattice of nodes: the weights of HOT's multigrid.

Coarse node c sits on fine node 2 c, in world indices, so that a hierarchy does not depend on where
the grid's storage begins. Finer nodes act as particles of the coarser level (HOT-impl): fine node
i hangs on coarse node c with the weight N(i/2 - c) of a B-spline, axis by axis.
"""

from typing import NamedTuple

import numpy as np
import scipy.sparse as sp

# N(i/2 - c) at i - 2 c = -t .. t (HOT-sec4.2-kernel).
TAPS = {
    "linear": (1 / 2, 1.0, 1 / 2),
    "quadratic": (1 / 8, 1 / 2, 3 / 4, 1 / 2, 1 / 8),
}


class Embedding(NamedTuple):
    """Weights of n fine nodes on m coarse ones: v_i = sum_c W_ic v_c."""

    W: sp.csr_array           # (n, m)   weights; a row sums to 1
    index: np.ndarray         # (m, d)   world index of coarse node, lexicographic


def taps(kernel):
    """Weights N(o/2), o = -t .. t, of one axis (HOT-sec4.2-kernel). Raises ValueError for a kernel
    that is neither "linear" nor "quadratic".
    """
    if kernel not in TAPS:
        raise ValueError(f"kernel = {kernel!r}: expected one of {', '.join(TAPS)}")
    return TAPS[kernel]


def parents(i, kernel):
    """Coarse indices and weights (n, k) along one axis of fine nodes with indices i (n,)."""
    w = taps(kernel)
    t = len(w) // 2
    first = -((t - i) // 2)                       # the smallest c with i - 2 c <= t, rounded up
    c = first[:, None] + np.arange(t + 1)
    offset = i[:, None] - 2 * c
    weight = np.array(w)[np.clip(offset + t, 0, 2 * t)]
    return c, np.where(abs(offset) <= t, weight, 0.0)


def embed(index, kernel="linear"):
    """Embedding of the nodes with world indices index (n, d), as in HOT-eq3 and HOT-eq4.

    A coarse node exists where a fine node has a positive weight. Negative indices are nodes like
    any others.
    """
    index = np.asarray(index, dtype=np.int64)
    low, box = _box(index)
    key, w = _weights(index, kernel, low, box)
    there = np.zeros(np.prod(box), dtype=bool)
    there[key[w > 0.0]] = True
    number = np.cumsum(there, dtype=np.int32) - 1
    coarse = np.stack(np.unravel_index(np.flatnonzero(there), box), axis=1) + low
    return Embedding(_matrix(w, number[key], w > 0.0, len(coarse)), coarse)


def embed_onto(index, coarse, kernel="linear"):
    """Weights (n, m) of nodes index (n, d) on the given coarse nodes (m, d), lexicographic.

    What would hang on other nodes is left out.
    """
    index = np.asarray(index, dtype=np.int64)
    low, box = _box(np.concatenate((index, 2 * coarse)))
    key, w = _weights(index, kernel, low, box)
    number = np.full(np.prod(box), -1, dtype=np.int32)
    number[np.ravel_multi_index(tuple((coarse - low).T), box)] = np.arange(len(coarse))
    return _matrix(w, number[key], (w > 0.0) & (number[key] >= 0), len(coarse))


def _box(index):
    """(lowest index, shape) of a box with all coarse nodes that nodes index (n, d) can hang on."""
    if not len(index):
        index = np.zeros((1, index.shape[1]), dtype=np.int64)
    low = index.min(axis=0) // 2 - 1
    return low, tuple(index.max(axis=0) // 2 + 3 - low)


def _weights(index, kernel, low, box):
    """(place in the box, weight), (n, k) each, of the coarse nodes around each node of index
    (n, d): lexicographic, with those of weight 0.
    """
    n = len(index)
    key, weight = np.zeros((n, 1), dtype=np.int64), np.ones((n, 1))
    for i, first, size in zip(index.T, low, box):
        c, w = parents(i, kernel)
        shape = n, key.shape[1] * c.shape[1]
        key = (key[:, :, None] * size + (c - first)[:, None, :]).reshape(shape)
        weight = (weight[:, :, None] * w[:, None, :]).reshape(shape)
    return key, weight


def _matrix(weight, column, keep, m):
    """csr_array (n, m) of those weights (n, k) that are kept, in columns that ascend in a row."""
    start = np.zeros(len(weight) + 1, dtype=np.int32)
    np.cumsum(keep.sum(axis=1), out=start[1:])
    return sp.csr_array((weight[keep], column[keep], start), shape=(len(weight), m))


# The geometric view: a level of the Galerkin hierarchy is MPM on a coarser grid, wider kernel.

def width(kernel, level):
    """Width of the particle-grid kernel of a level, in its own spacing (HOT-sec4.2-kernel).

    Level 0 is the quadratic B-spline, 3; linear embedding gives 2 + 2^-l, quadratic 4 - 2^-l.
    """
    reach = 3.0
    for _ in range(level):
        reach = (reach + len(taps(kernel)) - 1) / 2
    return reach


def kernel_value(x, kernel, level):
    """Particle-grid kernel of a level at distances x from its node, in that level's own spacing
    (HOT-eq8): w_l(x) = sum_o N(o/2) w_{l-1}(2 x - o), from the quadratic B-spline on level 0.
    Restricted forces are those of particles by its gradient (HOT-eq7).
    """
    x = np.asarray(x, dtype=float)
    if level == 0:
        r = abs(x)
        return np.where(r < 0.5, 0.75 - r**2, np.where(r < 1.5, 0.5 * (1.5 - r) ** 2, 0.0))
    w = taps(kernel)
    t = len(w) // 2
    return sum(w_o * kernel_value(2 * x - o, kernel, level - 1) for o, w_o in enumerate(w, -t))
