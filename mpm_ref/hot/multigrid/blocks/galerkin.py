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

from ....core.jit import CHUNKS, chunk, kernel, parallel_if_many, prange
from ....core.tensor import mat, mlin, put_mat, transpose
from ...assembly import pattern_of
from .sparse import BlockMatrix


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
    run: np.ndarray           # (blocks,)   length of the run that begins with a block, see `_runs`
    skip: int                 # places below belong to c' < c alone


class ContractionPlan(NamedTuple):
    """The contraction of S to a row of the coarse matrix."""

    taps: np.ndarray          # N(o/2) of one axis
    fine: int                 # width of S
    coarse: int               # width of the coarse stencil


@kernel
def _runs(A, key, run, bounds):
    """Lengths of the runs of rows: blocks that lie together in A and in S. They are written to
    places of first blocks.
    """
    for i in range(bounds[0], bounds[1]):
        k = A.start[i]
        while k < A.start[i + 1]:
            length = 1
            while (k + length < A.start[i + 1]
                   and key[A.column[k + length]] == key[A.column[k]] + length):
                length += 1
            run[k] = length
            k += length


@parallel_if_many
def _all_runs(A, key, run):
    for k in prange(CHUNKS):
        _runs(A, key, run, chunk(k, len(key)))


@kernel
def _gather(A, rows, c, S):
    """S[j - 2c] = sum_o N(o/2) H[2c + o, j], for one coarse node c, run by run."""
    data, size = A.data.reshape(-1), A.like.ndim ** 2
    S[rows.skip * size:] = 0.0
    for e in range(rows.start[c], rows.start[c + 1]):
        i = rows.child[e]
        k = A.start[i]
        while k < A.start[i + 1]:
            to = rows.key[A.column[k]] - rows.origin[c]
            if to >= rows.skip:
                _add(S, to * size, rows.weight[e], data, k * size, rows.run[k] * size)
            k += rows.run[k]


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
def _add(T, to, w, S, of, count):
    """T[to + q] += w S[of + q]. Unsigned indices let the compiler use vectors."""
    first, other = np.uint64(to), np.uint64(of)
    for q in range(np.uint64(count)):
        T[first + q] += w * S[other + q]


@kernel
def _write(C, slot, c, S):
    """Row c of the coarse matrix from its diagonal on, and its transpose; slot as in
    `assembly.Pattern.block`.
    """
    last = slot.shape[1] - 1
    for o in range(last // 2, last + 1):
        e = slot[c, o]
        if e >= 0:
            block = mat(S, o, C.like.shape)
            if C.column[e] == c:
                block = mlin(0.5, block, 0.5, transpose(block))
            put_mat(C.data, e, block)
            put_mat(C.data, slot[C.column[e], last - o], transpose(block))


@kernel
def _coarse_rows(A, rows, C, slot, plan, bounds):
    d = C.like.ndim
    pair = np.empty((2, plan.fine**d * d * d))
    for c in range(bounds[0], bounds[1]):
        _gather(A, rows, c, pair[0])
        source, target = pair[0], pair[1]
        for a in range(d):
            inner = plan.fine ** (d - 1 - a) * d * d
            _contract(source, target, _sizes(a, plan.fine, plan.coarse, inner), plan.taps)
            source, target = target, source
        _write(C, slot, c, source.reshape(-1, d, d))


@parallel_if_many
def _all_coarse_rows(A, rows, C, slot, plan):
    for k in prange(CHUNKS):
        _coarse_rows(A, rows, C, slot, plan, chunk(k, len(rows.origin)))


def _numbered(index):
    """The box (n1, .., nd) around nodes index (n, d) with their numbers; -1 where there is none."""
    place = index - index.min(axis=0)
    number = np.full(place.max(axis=0) + 1, -1, dtype=np.int32)
    number[tuple(place.T)] = np.arange(len(index))
    return number


def galerkin(A, index, to, coarse, radius, w):
    """bsr_array P^T A P of a BlockMatrix A for nodes index (n, d) that hang on nodes coarse (m, d)
    by the `Transfer` to, whose weights are products of the taps w of the axes; A couples up to
    `radius`.
    """
    d, reach = index.shape[1], coarse_radius(radius, w)
    wide = stencil(radius + len(w) // 2, d)
    key, run = index @ wide.stride, np.empty(len(A.column), dtype=np.int32)
    _all_runs(A, key, run)
    origin = 2 * coarse @ wide.stride - wide.centre
    rows = Rows(*to.down, key, origin, run, int(radius * wide.stride[0]))
    pattern = pattern_of(_numbered(coarse), reach)
    C = BlockMatrix(pattern.indptr, pattern.indices, np.empty((len(pattern.indices), d, d)), A.like)
    plan = ContractionPlan(np.array(w), wide.width, 2 * reach + 1)
    _all_coarse_rows(A, rows, C, pattern.block, plan)
    size = len(coarse) * d
    return sp.bsr_array((C.data, C.column, C.start), shape=(size, size))
