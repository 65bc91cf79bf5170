"""Sparse matrices of d x d blocks as arrays that kernels read."""

from typing import NamedTuple

import numpy as np

from ....core.jit import CHUNKS, chunk, kernel, parallel, prange
from ....core.tensor import cofactor, det, mat, mlin, put_mat, trace, transpose
from ..projectors import REGULAR, inverses, onto_range

BLOCK_SIZES = ((2, 2), (3, 3))
SERIAL = 4000                       # nodes below which starting threads costs more than they save


class BlockMatrix(NamedTuple):
    """Rows of blocks, as in scipy.sparse.bsr_array: row i is data[start[i] : start[i + 1]]."""

    start: np.ndarray      # (n + 1,)     int32
    column: np.ndarray     # (k,)         int32
    data: np.ndarray       # (k, d, d)
    like: np.ndarray       # no elements, d axes: the dimension, where kernels need to know it


def dimension_tag(d):
    """An array of d axes and no elements, to tell kernels the dimension: its shape is a d-tuple."""
    return np.empty((0,) * d)


def blocks_of(A):
    """BlockMatrix that shares the arrays of a bsr_array A, whose indices are sorted.

    Raises ValueError unless they are 2 x 2 or 3 x 3: kernels would write past the end of arrays.
    """
    if A.blocksize not in BLOCK_SIZES:
        raise ValueError(f"matrix in blocks of {A.blocksize}: expected (2, 2) or (3, 3), or "
                         "implementation = 'scipy'")
    return BlockMatrix(A.indptr, A.indices, A.data, dimension_tag(A.blocksize[0]))


@kernel
def place_from(A, i, j):
    """Place of the first block of row i whose column is j or more, in A, whose rows are sorted."""
    low, high = np.int64(A.start[i]), np.int64(A.start[i + 1])
    while low < high:
        middle = (low + high) // 2
        if A.column[middle] < j:
            low = middle + 1
        else:
            high = middle
    return low


@kernel
def _diagonal(A, D):
    for i in range(len(D)):
        e = place_from(A, i, i)
        if e < A.start[i + 1] and A.column[e] == i:
            put_mat(D, i, mat(A.data, e, A.like.shape))


def diagonal(A):
    """Diagonal blocks (n, d, d) of A; zero where one is not stored."""
    d = A.like.ndim
    D = np.zeros((len(A.start) - 1, d, d))
    _diagonal(A, D)
    return D


@kernel
def _coupling_radius(A, index, bounds):
    radius = 0
    for i in range(bounds[0], bounds[1]):
        for a in range(index.shape[1]):
            own = index[i, a]
            for e in range(np.uint64(A.start[i]), np.uint64(A.start[i + 1])):
                radius = max(radius, abs(index[np.uint64(A.column[e]), a] - own))
    return radius


@parallel
def _coupling_radii(A, index, radius):
    for c in prange(CHUNKS):
        radius[c] = _coupling_radius(A, index, chunk(c, len(index)))


def coupling_radius(A, index):
    """Largest distance along an axis, in nodes, between two nodes that A couples."""
    radius = np.zeros(CHUNKS, dtype=np.int64)
    _coupling_radii(A, index, radius)
    return int(radius.max())


# projectors and inverses of diagonal blocks: at once where a node moves freely, else as in
# `projectors`


@kernel
def _sort_out(D, regular, partly, like):
    """Which blocks surely have full rank, as `projectors.is_regular`; which others are not zero."""
    for i in range(len(D)):
        block = mat(D, i, like)
        mean = trace(block) / len(like)
        regular[i] = mean > 0.0 and det(mlin(1.0 / mean, block, 0.0, block)) > REGULAR
        partly[i] = not regular[i] and mean != 0.0


def _sorted_out(D):
    """(which blocks D (n, d, d) are regular, numbers of those that may be held in part)."""
    regular, partly = np.empty((2, len(D)), dtype=np.bool_)
    _sort_out(D, regular, partly, (0,) * D.shape[1])
    return regular, np.flatnonzero(partly)


def free_directions(D):
    """`projectors.onto_range` (n, d, d) of diagonal blocks D."""
    regular, partly = _sorted_out(D)
    B = regular[:, None, None] * np.eye(D.shape[1])
    B[partly] = onto_range(D[partly])
    return B


@kernel
def _invert(D, out, like):
    for i in range(len(D)):
        block, scale = mat(D, i, like), trace(mat(D, i, like))
        if scale > 0.0:
            block = mlin(1.0 / scale, block, 0.0, block)
        size = scale * det(block)
        if size > 0.0:
            put_mat(out, i, mlin(1.0 / size, transpose(cofactor(block)), 0.0, block))


def inverse_blocks(D, B):
    """Pseudo-inverses (n, d, d) of diagonal blocks D on the ranges of projectors B, as
    `projectors.inverses`.
    """
    out = np.zeros_like(D)
    _invert(D, out, (0,) * D.shape[1])
    _, partly = _sorted_out(D)
    out[partly] = inverses(D[partly], B[partly])
    return out
