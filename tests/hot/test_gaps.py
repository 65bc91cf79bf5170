"""Block kernels on matrices whose rows have gaps, against dense algebra."""

import numpy as np
import pytest
import scipy.sparse as sp

from mpm_ref.hot.multigrid.blocks.galerkin import galerkin
from mpm_ref.hot.multigrid.blocks.sparse import blocks_of, coupling_radius
from mpm_ref.hot.multigrid.blocks.sweep import split
from mpm_ref.hot.multigrid.blocks.transfer import transfer
from mpm_ref.hot.multigrid.embedding import embed, taps
from mpm_ref.hot.multigrid.smoothers import SLAB, coloured

RADIUS = 2
KINDS = ("full", "comb", "ragged")


def lattice(d, kind, rng, radius=RADIUS):
    """(symmetric matrix, world indices of its nodes): a box along the first axis that couples all
    its nodes over a radius; only its nodes of even last index; or part of its nodes and blocks.
    """
    shape = (15, 6) if d == 2 else (15, 4, 5)
    index = np.stack(np.indices(shape), axis=-1).reshape(-1, d) - 3
    if kind == "comb":
        index = index[index[:, -1] % 2 == 0]
    if kind == "ragged":
        index = index[rng.random(len(index)) < 0.8]
    n = len(index)
    there = abs(index[:, None] - index).max(axis=2) <= radius
    if kind == "ragged":                                  # blocks of the diagonal are missing too
        lower = np.tril(rng.random((n, n)) < 0.7)
        there &= lower | lower.T
    row, column = np.nonzero(there)
    data = np.zeros((n, n, d, d))
    data[row, column] = rng.standard_normal((len(row), d, d))
    data += data.transpose(1, 0, 3, 2)
    start = np.append(0, np.cumsum(there.sum(axis=1)))
    return sp.bsr_array((data[row, column], column, start), shape=(n * d, n * d)), index


@pytest.mark.parametrize("kernel", ["linear", "quadratic"])
@pytest.mark.parametrize("kind", KINDS)
def test_coarse_matrices(d, kind, kernel, rng):                       # HOT-eq6
    A, index = lattice(d, kind, rng)
    embedding = embed(index, kernel)
    to = transfer(embedding.W, np.tile(np.eye(d), (len(index), 1, 1)))
    C = galerkin(blocks_of(A), index, to, embedding.index, RADIUS, taps(kernel))
    P = np.kron(embedding.W.toarray(), np.eye(d))
    expected = P.T @ A.toarray() @ P
    assert abs(C.toarray() - expected).max() <= 1e-14 * abs(expected).max()
    assert (C != C.T).nnz == 0


def dense(half, rows):
    """Blocks (n, n, d, d) of the Planes of a half whose row k is that of node rows[k]."""
    d = len(half.data)
    blocks = np.zeros((len(rows), len(rows), d, d))
    row = np.repeat(rows, np.diff(half.start))
    blocks[row, half.column] = half.data.transpose(2, 0, 1)
    return blocks


@pytest.mark.parametrize("radius", [RADIUS, SLAB + 1])
@pytest.mark.parametrize("kind", KINDS)
def test_halves_in_the_order_of_the_sweep(d, kind, radius, rng):
    A, index = lattice(d, kind, rng, radius)
    n, order = len(index), coloured(index, max(SLAB, radius))
    place = np.argsort(order)
    m = split(blocks_of(A), np.zeros((n, d, d)), index, radius)
    blocks = A.toarray().reshape(n, d, n, d).transpose(0, 2, 1, 3)
    before = (place[None, :] < place[:, None])[:, :, None, None]
    after = (place[None, :] > place[:, None])[:, :, None, None]
    np.testing.assert_array_equal(dense(m.L, order), before * blocks)
    np.testing.assert_array_equal(dense(m.U, order[::-1]), after * blocks)
    on = np.count_nonzero(A.indices == np.repeat(np.arange(n), np.diff(A.indptr)))
    assert len(m.L.column) + len(m.U.column) + on == len(A.indices)
    for half in (m.L, m.U):
        row = np.repeat(np.arange(n), np.diff(half.start))
        assert (np.diff(row * n + half.column) > 0).all()              # columns ascend in a row


def test_coupling_radius_is_the_largest_of_all_axes(d):
    for axis in range(d):
        index = np.zeros((2, d), dtype=np.int64)
        index[1, axis] = 3
        A = sp.bsr_array(np.ones((2 * d, 2 * d)), blocksize=(d, d))
        assert coupling_radius(blocks_of(A), index) == 3
