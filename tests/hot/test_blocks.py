"""Block kernels are twins of the readable path, whatever is chosen, in any number of threads."""

import numba
import numpy as np
import pytest
import scipy.sparse as sp
from multigrid_matrices import case

from mpm_ref.core import jit
from mpm_ref.core.jit import set_threads
from mpm_ref.hot.multigrid import blocks
from mpm_ref.hot.multigrid.blocks.product import planes_of, product
from mpm_ref.hot.multigrid.blocks.sparse import (
    blocks_of,
    coupling_radius,
    diagonal,
    free_directions,
    inverse_blocks,
)
from mpm_ref.hot.multigrid.blocks.sweep import Sweep, correct, residual, split, sweep
from mpm_ref.hot.multigrid.hierarchy import hierarchy
from mpm_ref.hot.multigrid.projectors import diagonal_blocks, inverses, onto_range
from mpm_ref.hot.multigrid.smoothers import GaussSeidel


@pytest.fixture(scope="module", params=(2, 3), ids=("2d", "3d"))
def c(request):
    return case(request.param, size=7 if request.param == 2 else 3)


def close(a, b, tolerance=1e-12):
    assert abs(a - b).max() <= tolerance * abs(b).max()


def test_products_diagonals_and_inverses(c, rng):
    A, u = blocks_of(c.A), rng.standard_normal(c.index.shape)
    expected = (c.A @ u.reshape(-1)).reshape(u.shape)
    close(product(planes_of(A), u), expected, 1e-14)
    single = product(planes_of(A, np.float32), u)
    close(single, expected, 1e-6)
    close(single, (c.A.astype(np.float32).astype(float) @ u.reshape(-1)).reshape(u.shape), 1e-14)
    D = diagonal(A)
    np.testing.assert_array_equal(D, diagonal_blocks(c.A))
    B = onto_range(D)
    close(B, c.B)
    np.testing.assert_array_equal(free_directions(D), B)
    close(inverse_blocks(D, B), inverses(D, B))
    assert coupling_radius(A, c.index) == 2


def test_sweeps_keep_their_products(c, rng):                           # HOT-smoother
    b = np.einsum("iab,ib->ia", c.B, rng.standard_normal(c.index.shape))
    D = diagonal_blocks(c.A)
    D_inv = inverses(D, onto_range(D))
    smooth = GaussSeidel(c.A, D_inv, c.index)
    m = split(blocks_of(c.A), D_inv, c.index, 2)
    state = Sweep(np.full_like(b, np.nan), np.zeros_like(b), np.empty_like(b))
    expected, correction = np.zeros(b.size), c.B @ rng.standard_normal(b.shape)[:, :, None]
    for _ in range(2):
        for _ in range(2):
            sweep(m, b, state)
            expected += smooth(b.reshape(-1) - c.A @ expected)
            close(state.u.reshape(-1), expected)
        close(residual(m, state).reshape(-1), b.reshape(-1) - c.A @ expected)
        correct(m, state, correction[:, :, 0])
        expected += correction.reshape(-1)


@pytest.mark.parametrize("choices", [
    {}, {"sweeps": 2}, {"smoother": "jacobi"}, {"smoother": "chebyshev", "sweeps": 2},
    {"coarsest": "direct"}, {"preconditioner": "scalar"}, {"stop": "load", "tolerance": 0.1},
    {"kernel": "quadratic"}, {"levels": 1}, {"levels": 5}], ids=str)
def test_the_paths_are_twins(c, choices, rng):
    b = rng.standard_normal(c.index.shape)
    slow = hierarchy(c.A, c.index, implementation="scipy", **choices)
    fast = hierarchy(c.A, c.index, implementation="blocks", **choices)
    for ours, theirs in zip(fast.levels, slow.levels, strict=True):
        np.testing.assert_array_equal(ours.index, theirs.index)
        close(ours.A.toarray(), theirs.A.toarray())
    for _ in range(2):                                   # no memory of the cycle before
        close(fast.cycle(b), slow.cycle(b))
    assert fast.iterations == slow.iterations


@pytest.mark.parametrize("smoother", ["gauss-seidel", "chebyshev"])
def test_the_paths_are_twins_in_single_precision(c, smoother, rng):
    b = rng.standard_normal(c.index.shape)
    words = {"smoother": smoother, "coarsest": "direct"}
    slow, fast, double = (
        hierarchy(c.A, c.index, implementation=path, precision=precision, **words).cycle(b)
        for path, precision in (("scipy", "single"), ("blocks", "single"), ("blocks", "double")))
    close(fast, slow, 1e-6)              # sweeps know the diagonal blocks in double, SciPy's do not
    close(fast, double, 1e-5)
    assert (fast != double).any()


@pytest.mark.parametrize("power", [0, 2])
def test_matrices_of_another_radius(c, power):
    A = sp.csr_array(c.A)
    if power == 0:
        d = c.index.shape[1]
        row = np.arange(A.shape[0]) // d
        entry = A.tocoo()
        near = abs(c.index[row[entry.row]] - c.index[row[entry.col]]).max(axis=1) <= 1
        A = sp.csr_array((entry.data * near, (entry.row, entry.col)), shape=A.shape)
        A.eliminate_zeros()
        A = A + sp.diags_array(abs(A).sum(axis=1) * (A.diagonal() > 1e-12))
    else:
        A = A @ A
    A = sp.bsr_array(A, blocksize=c.A.blocksize)
    A.sort_indices()
    slow, fast = (hierarchy(A, c.index, 3, implementation=word).levels
                  for word in ("scipy", "blocks"))
    assert fast[0].radius == (1 if power == 0 else 4)
    for ours, theirs in zip(fast, slow, strict=True):
        close(ours.A.toarray(), theirs.A.toarray())


def test_the_same_bits_in_parallel(monkeypatch, rng):
    c = case(3, size=6)
    b = rng.standard_normal(c.index.shape)
    serial = hierarchy(c.A, c.index).cycle(b)
    for module in (blocks.product, blocks.sweep, blocks.transfer):
        monkeypatch.setattr(module, "SERIAL", 0)
    monkeypatch.setattr(jit, "few_items", 0)
    before = numba.get_num_threads()
    set_threads(min(2, numba.config.NUMBA_NUM_THREADS))
    try:
        np.testing.assert_array_equal(hierarchy(c.A, c.index).cycle(b), serial)
        monkeypatch.setattr(blocks.hierarchy, "SERIAL", 0)
        close(hierarchy(c.A, c.index).cycle(b), serial)
    finally:
        set_threads(before)
