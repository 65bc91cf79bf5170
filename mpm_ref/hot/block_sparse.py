"""Sparse matrices of d x d blocks as arrays that kernels read: products with vectors over nodes."""

from typing import NamedTuple

import numpy as np

from ..core.jit import CHUNKS, chunk, kernel, parallel, prange
from ..core.tensor import fill, lin, mat, mv, put_mat, put_vec, vec

SERIAL = 4000     # nodes below which starting threads costs more than they save


class Blocks(NamedTuple):
    """Rows of blocks, as in scipy.sparse.bsr_array: row i is data[start[i] : start[i + 1]]."""

    start: np.ndarray      # (n + 1,)     int32
    column: np.ndarray     # (k,)         int32
    data: np.ndarray       # (k, d, d)
    like: np.ndarray       # no elements, d axes: the dimension, where kernels need to know it


def no_nodes(d):
    """An array of d axes and no elements, to tell kernels the dimension: its shape is a d-tuple."""
    return np.empty((0,) * d)


def blocks_of(A):
    """Blocks that share the arrays of a bsr_array A, whose indices are sorted."""
    return Blocks(A.indptr, A.indices, A.data, no_nodes(A.blocksize[0]))


@kernel
def row_times(A, k, u):
    """Row k of A times u (n, d)."""
    s = fill(0.0, A.like.shape)
    for e in range(A.start[k], A.start[k + 1]):
        s = lin(1.0, s, 1.0, mv(mat(A.data, e, A.like.shape), vec(u, A.column[e], A.like.shape)))
    return s


@kernel
def _times(A, u, out, bounds):
    for i in range(bounds[0], bounds[1]):
        put_vec(out, i, row_times(A, i, u))


@parallel
def _times_all(A, u, out):
    for c in prange(CHUNKS):
        _times(A, u, out, chunk(c, len(out)))


def product(A, u):
    """A u (n, d) of Blocks A and u (n, d)."""
    out = np.empty_like(u)
    if len(out) < SERIAL:
        _times(A, u, out, (0, len(out)))
    else:
        _times_all(A, u, out)
    return out


@kernel
def find(A, i, j):
    """Place of block (i, j) in A, whose rows are sorted; -1 if it is not stored."""
    low, high = A.start[i], A.start[i + 1]
    while low < high:
        middle = (low + high) // 2
        if A.column[middle] < j:
            low = middle + 1
        else:
            high = middle
    if low < A.start[i + 1] and A.column[low] == j:
        return low
    return -1


@kernel
def _diagonal(A, D):
    for i in range(len(D)):
        e = find(A, i, i)
        if e >= 0:
            put_mat(D, i, mat(A.data, e, A.like.shape))


def diagonal(A):
    """Diagonal blocks (n, d, d) of A; zero where one is not stored."""
    d = A.like.ndim
    D = np.zeros((len(A.start) - 1, d, d))
    _diagonal(A, D)
    return D


@kernel
def _reach(A, index, bounds):
    reach = 0
    for i in range(bounds[0], bounds[1]):
        for e in range(A.start[i], A.start[i + 1]):
            for a in range(index.shape[1]):
                reach = max(reach, abs(index[A.column[e], a] - index[i, a]))
    return reach


@parallel
def _reaches(A, index, reach):
    for c in prange(CHUNKS):
        reach[c] = _reach(A, index, chunk(c, len(index)))


def reach_of(A, index):
    """Largest distance along an axis, in nodes, between two nodes that A couples."""
    reach = np.zeros(CHUNKS, dtype=np.int64)
    _reaches(A, index, reach)
    return int(reach.max())
