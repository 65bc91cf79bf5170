"""Samples with weights."""

from itertools import pairwise

import numpy as np
import pytest

from mpm_ref.rom.cubature import cubature, gains, misfit

N, R_FREE = 400, 3


@pytest.fixture(scope="module")
def modes():
    """Orthonormal smooth modes (n, 2, 8) of points in a square."""
    rng = np.random.default_rng(0)
    x = rng.random((N, 2))
    waves = [np.cos(np.pi * (i * x[:, 0] + j * x[:, 1]) + i) for i in range(3) for j in range(3)]
    U = np.stack([np.stack(pair, axis=1) for pair in pairwise(waves)], axis=2)
    Q, _ = np.linalg.qr(U.reshape(2 * N, -1))
    return Q.reshape(N, 2, -1)


def off(U, points, w):
    """How far weighted products are from those of all points, in units of the free modes."""
    products = np.einsum("p,pdk,pdl->kl", w, U[points][:, :, :R_FREE], U[points])
    products *= R_FREE / np.trace(products[:, :R_FREE])
    return np.linalg.norm(products - np.eye(R_FREE, U.shape[2]))


def test_weights_beat_none(modes):
    found = cubature(modes, R_FREE, np.arange(N), 20)
    assert len(found.points) <= 20
    assert (found.w > 0.0).all()
    assert found.w.mean() == pytest.approx(1.0)
    assert (np.diff(found.points) > 0).all()
    rng = np.random.default_rng(1)
    others = [off(modes, rng.choice(N, 20, replace=False), np.ones(20)) for _ in range(20)]
    assert off(modes, found.points, found.w) < 0.1 * min(others)


def test_products_of_single_modes_are_double(modes):
    single = modes.astype(np.float32)
    ours, exact = (cubature(U, R_FREE, np.arange(N), 20) for U in (single, single.astype(float)))
    assert np.array_equal(ours.w, exact.w)
    assert ours.misfit == exact.misfit
    points = np.arange(0, N, 9)
    assert misfit(single, R_FREE, points) == misfit(single.astype(float), R_FREE, points)


def test_what_is_left_is_told(modes):
    found = cubature(modes, R_FREE, np.arange(N), 6)
    assert found.misfit > 0.05
    finer = cubature(modes, R_FREE, np.arange(N), 40)
    assert finer.misfit < 1e-6


def test_points_without_weights_leave_more_the_fewer_they_are(modes):
    """All leave nothing; of few it is what the best weight, looked for by trial, leaves."""
    assert misfit(modes, R_FREE, np.arange(N)) < 1e-12
    few, more = (np.random.default_rng(0).choice(N, count, replace=False) for count in (5, 100))
    found = [misfit(modes, R_FREE, points) for points in (more, few, few[:1])]
    assert 0.0 < found[0] < found[1] < found[2] < 1.0
    products = np.einsum("pdk,pdl->kl", modes[few][..., :R_FREE], modes[few])
    wanted = np.eye(R_FREE, modes.shape[2])
    best = min(np.linalg.norm(scale * products - wanted) for scale in np.geomspace(1e-2, 1e4, 4000))
    assert found[1] == pytest.approx(best / np.linalg.norm(wanted), rel=1e-4)


def test_modes_that_vanish_at_points_leave_all(modes):
    assert misfit(np.zeros_like(modes), R_FREE, np.arange(3)) == 1.0


def test_a_motion_along_other_modes_leaves_no_trace(modes):
    """Least squares with the weights, of a motion in the modes beyond the free ones."""
    found = cubature(modes, R_FREE, np.arange(N), 40)
    root = np.sqrt(found.w)[:, None, None]
    A = (root * modes[found.points][:, :, :R_FREE]).reshape(-1, R_FREE)
    b = (root[..., 0] * modes[found.points][:, :, R_FREE:].sum(axis=2)).ravel()
    assert np.abs(np.linalg.lstsq(A, b, rcond=None)[0]).max() < 1e-5


def test_only_points_that_are_offered_are_taken(modes):
    among = np.arange(100, 200)
    assert np.isin(cubature(modes, R_FREE, among, 20).points, among).all()


def test_too_few_samples(modes):
    with pytest.raises(ValueError, match="1 samples for 3 latent coordinates: expected at least 2"):
        cubature(modes, R_FREE, np.arange(N), 1)


def test_no_more_points_are_kept_than_there_are_products(modes):
    found = cubature(modes, R_FREE, np.arange(N), 200)
    assert len(found.points) <= R_FREE * modes.shape[2] - R_FREE * (R_FREE - 1) // 2
    assert found.misfit < 1e-6


def test_points_where_modes_vanish_are_refused(modes):
    still = modes.copy()
    still[:50] = 0.0
    with pytest.raises(ValueError, match="0 points of 50 have a weight, too few for 3 latent"):
        cubature(still, R_FREE, np.arange(50), 20)


# Cell by cell.

CELL = np.arange(N) // 8    # of points next to each other in the list


def test_points_are_those_of_so_many_cells(modes):
    found = cubature(modes, R_FREE, np.arange(N), 4, CELL)
    assert len({*CELL[found.points]}) <= 4 < len(found.points)
    assert (found.w > 0.0).all()
    assert found.w.mean() == pytest.approx(1.0)
    assert (np.diff(found.points) > 0).all()


def test_points_of_a_cell_leave_less_than_one_of_it(modes):
    for count in (2, 4, 8):
        alone, whole = (cubature(modes, R_FREE, np.arange(N), count, cell).misfit
                        for cell in (None, CELL))
        assert whole < alone


def test_cells_of_one_point_are_points(modes):
    one, other = (cubature(modes, R_FREE, np.arange(N), 20, cell) for cell in (None, np.arange(N)))
    assert np.array_equal(one.points, other.points)
    assert one.w == pytest.approx(other.w)


def test_cells_are_taken_of_the_points_that_are_offered(modes):
    among = np.flatnonzero(np.isin(CELL, (3, 7, 11)))
    own = np.unique(CELL[among], return_inverse=True)[1]
    found = cubature(modes, R_FREE, among, 20, own)
    assert {*CELL[found.points]} <= {3, 7, 11}


def test_a_cell_is_worth_the_part_of_it_that_is_of_use():
    """By hand: components 3, 4 and -12 of columns 5, 12 and 13 long."""
    found = gains(np.array([3.0, 4.0, -12.0]), np.array([5.0, 12.0, 13.0]), np.array([0, 0, 1]))
    assert found == pytest.approx([5.0 / 13.0, 0.0])
    alone = gains(np.array([3.0, 4.0, -12.0]), np.array([5.0, 12.0, 0.0]), None)
    assert alone == pytest.approx([0.6, 1.0 / 3.0, 0.0])


def test_cells_where_modes_vanish_are_refused(modes):
    with pytest.raises(ValueError, match=r"0 points of 400 have a weight.*more cells"):
        cubature(np.zeros_like(modes), R_FREE, np.arange(N), 3, CELL)
