"""Which blocks a matrix over nodes has: one for every pair of nodes that a particle can reach."""

from typing import NamedTuple

import numpy as np

from ..core.jit import CHUNKS, chunk, kernel, parallel, prange


class Pattern(NamedTuple):
    """Block sparsity of n rows; o numbers the (2 q + 1)^d offsets of nodes within reach of splines
    of degree q, first axis slowest.
    """

    indptr: np.ndarray     # (n + 1,)        first block of each row
    indices: np.ndarray    # (blocks,)       column of each block, ascending in a row
    block: np.ndarray      # (n, offsets)    block of a row and an offset; -1 where there is none
    degree: int


def pattern_of(number, degree):
    """`Pattern` of the nodes that `number` (n1, .., nd) numbers; it is -1 where there is none."""
    d, width = number.ndim, 2 * degree + 1
    padded = np.pad(number, degree, constant_values=-1)
    node = np.flatnonzero(padded.reshape(-1) >= 0)
    hop = strides(padded.shape) @ (np.indices(d * (width,)).reshape(d, -1) - degree)
    indptr = np.zeros(len(node) + 1, dtype=np.int32)
    _count_all(padded.reshape(-1), node, hop, indptr)
    np.cumsum(indptr, out=indptr)
    indices = np.empty(indptr[-1], dtype=np.int32)
    block = np.empty((len(node), len(hop)), dtype=np.int32)
    _place_all(padded.reshape(-1), node, hop, Pattern(indptr, indices, block, degree))
    return Pattern(indptr, indices, block, degree)


def strides(shape):
    """Numbers of entries from one to the next along each axis of a C-ordered array."""
    return np.concatenate((np.cumprod(shape[:0:-1])[::-1], [1])).astype(np.int64)


@kernel
def count(number, node, hop, indptr, bounds):
    """indptr[i + 1] = blocks of row i, for the rows bounds[0] .. bounds[1] - 1."""
    for i in range(bounds[0], bounds[1]):
        for o in range(len(hop)):
            if number[node[i] + hop[o]] >= 0:
                indptr[i + 1] += 1


@kernel
def place(number, node, hop, pattern, bounds):
    """Columns and block numbers of the rows bounds[0] .. bounds[1] - 1."""
    for i in range(bounds[0], bounds[1]):
        k = pattern.indptr[i]
        for o in range(len(hop)):
            column = number[node[i] + hop[o]]
            pattern.block[i, o] = -1
            if column >= 0:
                pattern.indices[k] = column
                pattern.block[i, o] = k
                k += 1


@parallel
def _count_all(number, node, hop, indptr):
    for c in prange(CHUNKS):
        count(number, node, hop, indptr, chunk(c, len(node)))


@parallel
def _place_all(number, node, hop, pattern):
    for c in prange(CHUNKS):
        place(number, node, hop, pattern, chunk(c, len(node)))
