"""Embedding of lattices into coarser ones: weights, kernels of the levels, free directions."""

from itertools import product

import numpy as np
import pytest
from multigrid_matrices import NORMAL

from mpm_ref.hot.multigrid.embedding import TAPS, embed, embed_onto, kernel_value, width
from mpm_ref.hot.multigrid.projectors import coarse_nodes, inverses, onto_range

KERNELS = ("linear", "quadratic")


def ragged(d, rng):
    """Lexicographic indices of two thirds of a box around the origin."""
    box = np.array(list(product(range(-5, 4), repeat=d)))
    return box[rng.random(len(box)) < 0.67]


def spline(x, kernel):
    """B-spline of degree 1 or 2."""
    x = abs(x)
    if kernel == "linear":
        return np.maximum(1 - x, 0)
    return np.where(x < 0.5, 0.75 - x**2, np.maximum(1.5 - x, 0) ** 2 / 2)


@pytest.mark.parametrize("kernel", KERNELS)
def test_what_hangs_on_other_nodes_is_left_out(d, kernel, rng):
    index = ragged(d, rng)
    W, coarse = embed(index, kernel)
    given = rng.random(len(coarse)) < 0.5
    onto = embed_onto(index, coarse[given], kernel)
    np.testing.assert_array_equal(onto.toarray(), W.toarray()[:, given])
    assert onto.nnz == np.count_nonzero(onto.toarray())


@pytest.mark.parametrize("kernel", KERNELS)
def test_weights_are_those_of_the_spline_at_every_pair(d, kernel, rng):        # HOT-impl
    index = ragged(d, rng)
    W, coarse = embed(index, kernel)
    assert W.sum(axis=1) == pytest.approx(1.0, abs=1e-15)          # HOT-eq4: constants are kept
    dense = spline(index[:, None] / 2 - coarse, kernel).prod(axis=2)
    np.testing.assert_array_equal(W.toarray(), dense)
    assert (W.sum(axis=0) > 0).all()
    assert coarse.tolist() == sorted(coarse.tolist())


@pytest.mark.parametrize("kernel", KERNELS)
def test_linear_fields_are_kept(d, kernel, rng):
    index = ragged(d, rng)
    W, coarse = embed(index, kernel)
    np.testing.assert_allclose(W @ (2.0 * coarse), index, atol=1e-14)


@pytest.mark.parametrize("kernel", KERNELS)
@pytest.mark.parametrize("shift", [-64, 2 * 10**9])         # so far away no box reaches the origin
def test_a_hierarchy_moves_with_the_lattice(d, kernel, shift, rng):
    index = ragged(d, rng)
    (W, coarse), (V, moved) = embed(index, kernel), embed(index + shift, kernel)
    assert (W != V).nnz == 0
    np.testing.assert_array_equal(moved, coarse + shift // 2)


def test_at_most_three_nodes_per_axis_meet_in_a_transfer(d, rng):      # HOT-nnz
    W, _ = embed(ragged(d, rng), "linear")
    assert np.diff(W.indptr).max() == 2**d
    assert np.diff(W.T.tocsr().indptr).max() <= 3**d


@pytest.mark.parametrize(("kernel", "widths"), [
    ("linear", (3, 2.5, 2.25, 2.125)), ("quadratic", (3, 3.5, 3.75, 3.875))])
def test_kernel_widths_of_the_levels(kernel, widths):                  # HOT-sec4.2-kernel
    assert tuple(width(kernel, level) for level in range(4)) == widths
    for level, w in enumerate(widths):
        edge = np.array([w / 2 - 1e-3, w / 2 + 1e-12])
        inside, outside = kernel_value(edge, kernel, level)
        assert inside > 0 == outside


@pytest.mark.parametrize("kernel", KERNELS)
@pytest.mark.parametrize("level", range(4))
def test_kernels_of_the_levels_sum_to_one(kernel, level):
    x = np.linspace(-0.5, 0.5, 11)
    total = sum(kernel_value(x - i, kernel, level) for i in range(-3, 4))
    np.testing.assert_allclose(total, 1.0, atol=1e-14)


@pytest.mark.parametrize("kernel", KERNELS)
def test_a_level_is_mpm_with_its_own_kernel(kernel):                   # HOT-eq7, HOT-eq8
    index, x = np.arange(-9, 10)[:, None], 0.3
    w = kernel_value(x - index[:, 0], kernel, 0)
    for level in range(1, 4):
        W, index = embed(index, kernel)
        w = W.T @ w
        expected = kernel_value(x / 2**level - index[:, 0], kernel, level)
        np.testing.assert_allclose(w, expected, atol=1e-15)


def test_an_unknown_kernel_is_refused():
    with pytest.raises(ValueError, match="kernel = 'cubic': expected one of linear, quadratic"):
        embed(np.zeros((1, 2)), "cubic")


def test_taps_are_the_two_scale_relation():
    assert all(sum(w) == 2.0 for w in TAPS.values())


def test_range_and_inverse_of_blocks(d):
    n = NORMAL[d]
    slip = np.eye(d) - np.outer(n, n)
    D = 1e-9 * np.stack([np.eye(d) + 3 * np.outer(n, n), slip @ np.diag(range(1, d + 1)) @ slip,
                         np.zeros((d, d)), np.diag([0.0] + [1.0] * (d - 1))])
    B = onto_range(D)
    np.testing.assert_allclose(B[:3], [np.eye(d), slip, np.zeros((d, d))], atol=1e-14)
    np.testing.assert_allclose(B[3], np.diag([0.0] + [1.0] * (d - 1)), atol=1e-14)
    D_inv = inverses(D, B)
    np.testing.assert_allclose(D_inv, np.linalg.pinv(D, rcond=1e-10, hermitian=True), rtol=1e-12,
                               atol=1e-12 * abs(D_inv).max())


def test_coarse_directions_are_free_where_any_finer_one_is(d):         # HOT-bc
    index = np.array(list(product(range(4), repeat=d)))
    B = np.tile(np.eye(d), (len(index), 1, 1))
    B[index[:, 0] <= 2] = 0.0
    B[index[:, 0] == 3] = np.diag([0.0] + [1.0] * (d - 1))
    (W, coarse), B_coarse = coarse_nodes(index, B, "linear")
    assert set(coarse[:, 0]) == {1, 2}                # node 0 has held nodes only, hence is gone
    np.testing.assert_allclose(B_coarse, B[-1][None].repeat(len(coarse), 0), atol=1e-15)
    assert (np.diff(W.indptr) > 0).tolist() == (index[:, 0] == 3).tolist()
