"""Coarse matrices by stencil: H_coarse = R H R^T (HOT-eq6) without sparse products.

Coarse node c sits on fine node 2 c, and nodes that hang on it are 2 c + o, |o| <= t on each axis.
First the rows of those nodes are added up with their weights, into all offsets j - 2 c; then the
columns, axis by axis, since the weights are products of the axes' weights:

    S[j - 2c] = sum_o N(o/2) H[2c + o, j],        H_coarse[c, c'] = sum_o N(o/2) S[2 (c' - c) + o]

Only c' >= c is formed; the rest is its transpose, so that coarse matrices are symmetric to the bit.
"""

from typing import NamedTuple

import numpy as np
import scipy.sparse as sp

from ....core.jit import CHUNKS, chunk, kernel, parallel, prange
from ....core.tensor import mat, mlin, put_mat, transpose
from .sparse import BlockMatrix, find


class Stencil(NamedTuple):
    """Places of offsets -radius .. radius of every axis in a block of offsets, last axis fastest.

    The place of offset o is centre + sum_a o_a stride_a, so that it is linear in the nodes' keys
    sum_a index_a stride_a: place = centre + key_j - key_i.
    """

    width: int                # 2 radius + 1
    centre: int
    stride: np.ndarray        # (d,)


def stencil(radius, d):
    """Stencil of offsets up to `radius` in d dimensions."""
    width = 2 * radius + 1
    return Stencil(width, width**d // 2, width ** np.arange(d - 1, -1, -1, dtype=np.int64))


def coarse_radius(radius, w):
    """Reach of the coarse matrix for taps w over -t .. t: |2 c' - 2 c| <= radius + 2 t (HOT-nnz: 2
    stays 2 for linear embedding, t = 1).
    """
    return (radius + len(w) - 1) // 2


class Rows(NamedTuple):
    """Rows of H that hang on coarse nodes, and where their columns go in S."""

    start: np.ndarray         # (m + 1,)    those of coarse node c: child[start[c] : start[c + 1]]
    child: np.ndarray         # (k,)        fine node
    weight: np.ndarray        # (k,)
    key: np.ndarray           # (n,)        of fine node, in the stencil of S
    origin: np.ndarray        # (m,)        key of fine node 2 c, minus the centre of S
    skip: int                 # places below belong to c' < c alone


class ContractionPlan(NamedTuple):
    """The contraction of S to a row of the coarse matrix."""

    taps: np.ndarray          # N(o/2) of one axis
    fine: int                 # width of S
    coarse: int               # width of the coarse stencil
    centre: int               # place of offset 0 in it
    key: np.ndarray           # (m,)  of coarse node, in the coarse stencil


@kernel
def _gather(A, rows, c, S):
    """S[j - 2c] = sum_o N(o/2) H[2c + o, j], for one coarse node c."""
    like = A.like.shape
    S[:] = 0.0
    for e in range(rows.start[c], rows.start[c + 1]):
        i, w = rows.child[e], rows.weight[e]
        for k in range(A.start[i], A.start[i + 1]):
            at = rows.key[A.column[k]] - rows.origin[c]
            if at >= rows.skip:
                put_mat(S, at, mlin(1.0, mat(S, at, like), w, mat(A.data, k, like)))


@kernel
def _contract(S, T, sizes, w):
    """T[p, k, q] = sum_o w_o S[p, 2k + o, q]: the columns, along one axis.

    sizes = (outer, fine, coarse, inner) numbers of places, of which outer and coarse are ranges;
    offsets are centred in fine and coarse.
    """
    outer, fine, coarse, inner = sizes
    t = len(w) // 2
    for p in range(outer[0], outer[1]):
        for k in range(coarse[0], coarse[1]):
            to = (p * coarse[1] + k) * inner
            T[to:to + inner] = 0.0
            for o in range(-t, t + 1):
                j = 2 * (k - coarse[1] // 2) + o + fine // 2
                if 0 <= j < fine:
                    _add(T, to, w[o + t], S, (p * fine + j) * inner, inner)


@kernel
def _sizes(axis, fine, coarse, inner):
    """Sizes of `_contract`: only offsets from 0 on are wanted along the first axis."""
    half = coarse // 2
    if axis == 0:
        return (0, 1), fine, (half, coarse), inner
    block = coarse ** (axis - 1)
    return (half * block, coarse * block), fine, (0, coarse), inner


@kernel
def _add(T, to, w, S, at, count):
    for q in range(count):
        T[to + q] += w * S[at + q]


@kernel
def _write(C, plan, c, S):
    """Row c of the coarse matrix from its diagonal on, and its transpose."""
    here = plan.centre - plan.key[c]
    for e in range(C.start[c], C.start[c + 1]):
        if C.column[e] >= c:
            block = mat(S, plan.key[C.column[e]] + here, C.like.shape)
            if C.column[e] == c:
                block = mlin(0.5, block, 0.5, transpose(block))
            put_mat(C.data, e, block)
            put_mat(C.data, find(C, C.column[e], c), transpose(block))


@kernel
def _coarse_rows(A, rows, C, plan, scratch, bounds):
    d = C.like.ndim
    S, T = scratch
    for c in range(bounds[0], bounds[1]):
        _gather(A, rows, c, S.reshape(-1, d, d)[: plan.fine**d])
        source, target = S, T
        for a in range(d):
            inner = plan.fine ** (d - 1 - a) * d * d
            _contract(source, target, _sizes(a, plan.fine, plan.coarse, inner), plan.taps)
            source, target = target, source
        _write(C, plan, c, source.reshape(-1, d, d))


@parallel
def _all_coarse_rows(A, rows, C, plan, scratch):
    for k in prange(CHUNKS):
        pair = scratch[0, k], scratch[1, k]
        _coarse_rows(A, rows, C, plan, pair, chunk(k, len(rows.origin)))


@kernel
def _count(box, place, offsets, start, bounds):
    for c in range(bounds[0], bounds[1]):
        for k in range(len(offsets)):
            start[c + 1] += box[place[c] + offsets[k]] >= 0


@kernel
def _fill(box, place, offsets, start, column, bounds):
    for c in range(bounds[0], bounds[1]):
        to = start[c]
        for k in range(len(offsets)):
            j = box[place[c] + offsets[k]]
            if j >= 0:
                column[to] = j
                to += 1


def pattern(index, radius):
    """(start, column) of the matrix that couples all nodes within `radius` of each other, for nodes
    index (n, d) in lexicographic order.
    """
    low = index.min(axis=0) - radius
    shape = index.max(axis=0) + radius + 1 - low
    stride = np.append(np.cumprod(shape[:0:-1])[::-1], 1)
    place = (index - low) @ stride
    box = np.full(np.prod(shape), -1, dtype=np.int32)
    box[place] = np.arange(len(index), dtype=np.int32)
    one = np.arange(-radius, radius + 1)
    axes = np.meshgrid(*[one] * index.shape[1], indexing="ij")
    offsets = sum(a * s for a, s in zip(axes, stride)).reshape(-1)
    start = np.zeros(len(index) + 1, dtype=np.int32)
    _count(box, place, offsets, start, (0, len(index)))
    np.cumsum(start, out=start)
    column = np.empty(start[-1], dtype=np.int32)
    _fill(box, place, offsets, start, column, (0, len(index)))
    return start, column


def galerkin(A, index, to, coarse, radius, w):
    """bsr_array P^T A P of a BlockMatrix A for nodes index (n, d) that hang on nodes coarse (m, d)
    by the `Transfer` to, whose weights are products of the taps w of the axes; A couples up to
    `radius`.
    """
    d, t = index.shape[1], len(w) // 2
    wide, narrow = stencil(radius + t, d), stencil(coarse_radius(radius, w), d)
    origin = 2 * coarse @ wide.stride - wide.centre
    rows = Rows(*to.down, index @ wide.stride, origin, int(radius * wide.stride[0]))
    start, column = pattern(coarse, narrow.width // 2)
    C = BlockMatrix(start, column, np.empty((len(column), d, d)), A.like)
    scratch = np.empty((2, CHUNKS, wide.width**d * d * d))
    key = coarse @ narrow.stride
    plan = ContractionPlan(np.array(w), wide.width, narrow.width, narrow.centre, key)
    _all_coarse_rows(A, rows, C, plan, scratch)
    size = len(coarse) * d
    return sp.bsr_array((C.data, C.column, C.start), shape=(size, size))
