"""Samples, and the points that share a node with them, against a search over nodes and points."""

from itertools import product

import numpy as np
import pytest
from rom_toys import cloud, decoder

from mpm_ref.core.motion import rotation
from mpm_ref.core.spline import STENCILS, base_of
from mpm_ref.rom.fields import blocks as block_module
from mpm_ref.rom.fields.affine import Affine
from mpm_ref.rom.fields.blocks import SAFETY, blocks
from mpm_ref.rom.quadrature.lagrangian import CELLS, lagrangian
from mpm_ref.rom.quadrature.stencil_overlap import stencil_overlap
from mpm_ref.rom.sampling import PER_GROUP, draw

DX = 0.11


@pytest.fixture(params=(2, 3), ids=("quadratic", "cubic"))
def degree(request):
    """Of the splines."""
    return request.param


def stencils(x, dx, degree):
    """The nodes that each of the points x reaches, as sets."""
    stencil = STENCILS[degree]
    return [set(product(*[[int(base_of(x_a, dx, stencil)) + k for k in stencil] for x_a in point]))
            for point in x]


def sharing(x, samples, dx, degree):
    """Whether each of the points x shares a node with a sample, by a search over all nodes."""
    held = set().union(*stencils(samples, dx, degree))
    return np.array([not held.isdisjoint(nodes) for nodes in stencils(x, dx, degree)])


def bent(d):
    """A learned map, and latent coordinates."""
    return decoder(d, 3), np.array([0.9, -0.8, 0.7])


def stretched(d):
    """An affine map that stretches threefold, squeezes and turns."""
    R = rotation(0.9, None if d == 2 else (1.0, 2.0, -1.0))
    A = R @ np.diag((3.0, 0.4, 1.7)[:d]) @ R
    return Affine(d), np.hstack([A, np.full((d, 1), -0.3)]).ravel()


MAPS = {"bent": bent, "stretched": stretched}


@pytest.fixture(params=MAPS)
def moved(request, d):
    """A map and latent coordinates."""
    return MAPS[request.param](d)


# nodes

def scattered(d, rng):
    """Samples and points around them, on both sides of the origin."""
    return rng.uniform(-0.3, 0.3, (4, d)), rng.uniform(-1.0, 1.0, (500, d)), DX


def aligned(d, rng):
    """The same on nodes, midpoints of cells and quarters, where bases change."""
    dx = 0.125
    samples, x = (rng.integers(-4 * n, 4 * n, (k, d)) * dx / 4 for n, k in ((3, 4), (9, 500)))
    return samples, x, dx


@pytest.mark.parametrize("points", [scattered, aligned])
def test_reached_points_are_those_that_share_a_node(points, d, degree, rng):
    samples, x, dx = points(d, rng)
    expected = sharing(x, samples, dx, degree)
    assert 0 < expected.sum() < len(x)
    within = stencil_overlap(samples, dx, degree)
    assert np.array_equal(within.overlaps(x), expected)
    assert [point in within for point in x] == expected.tolist()


def test_samples_reach_themselves(d, degree):
    x = cloud(d, 30)
    assert stencil_overlap(x, DX, degree).overlaps(x).all()


def test_cells_are_exactly_the_bases_within_reach(d, degree, rng):
    samples = rng.uniform(-0.2, 0.2, (3, d))
    own = np.array([min(nodes) for nodes in stencils(samples, DX, degree)])
    low, high = own.min(axis=0) - degree - 2, own.max(axis=0) + degree + 3
    held = set().union(*stencils(samples, DX, degree))
    expected = [base for base in product(*map(range, low, high))
                if not held.isdisjoint(product(*[range(k, k + degree + 1) for k in base]))]
    overlap = stencil_overlap(samples, DX, degree)
    assert overlap.cells().tolist() == [list(base) for base in expected]


# blocks

@pytest.fixture(params=("sparse", "dense"))
def body(request, d):
    """Points and the grid's spacing: about half a point in a block, or many."""
    if request.param == "dense":
        return cloud(d, 800), DX
    return cloud(d, 50), 0.05 if d == 2 else DX


@pytest.fixture(params=(500, 2), ids=("one level", "more levels"))
def many(request, monkeypatch):
    """How many blocks are not in larger ones."""
    monkeypatch.setattr(block_module, "MANY", request.param)
    return request.param


def test_blocks_hold_every_point_once(d):
    X = cloud(d, 300)
    found = blocks(X, 2 * DX)
    assert np.array_equal(np.sort(found.order), np.arange(300))
    assert len(found.center) > 10
    for k, (a, b) in enumerate(zip(found.start[:-1], found.start[1:], strict=True)):
        own = X[found.order[a:b]]
        assert b > a
        assert len(np.unique(np.floor(own / (2 * DX)), axis=0)) == 1
        assert found.center[k] == pytest.approx(own.mean(axis=0), rel=1e-13)
        far = np.linalg.norm(own - own.mean(axis=0), axis=1).max()
        assert found.radius[k] == pytest.approx(far, rel=1e-12, abs=1e-15)


def test_no_point_is_farther_from_its_block_than_the_bound(moved, d):
    (map, xhat), X = moved, cloud(d, 800)
    held = blocks(X, CELLS * DX)
    at, F, _ = map.derivatives(held.center, xhat)
    bound = SAFETY * np.linalg.svd(F)[1].max() * held.radius
    block = np.repeat(np.arange(len(at)), np.diff(held.start))
    far = np.linalg.norm(map.place(X[held.order], xhat) - at[block], axis=1)
    assert (far <= bound[block] + 1e-15).all()
    assert far.max() > 0.1 * bound.max()


def test_no_point_near_a_position_is_missed(moved, body, many):
    (map, xhat), (X, dx) = moved, body
    x = map.place(X, xhat)
    targets = x[:2] + 0.01
    away = np.abs(x[:, None] - targets).max(axis=2).min(axis=1)
    distance = np.quantile(away, 0.1)
    found = blocks(X, CELLS * dx).near(map, xhat, targets, distance)
    assert set(np.flatnonzero(away <= distance)) <= set(found)
    assert len(set(found)) == len(found) < len(X)


def test_larger_blocks_leave_out_blocks_that_are_far(d):
    """Those found are as few as without them, from fewer evaluations."""
    X, asked = cloud(d, 4000), []

    class Counted(Affine):
        def derivatives(self, X, xhat):
            asked.append(len(X))
            return super().derivatives(X, xhat)

    map, x = Counted(d), X[:1]
    held = blocks(X, 0.25 * DX)
    assert held.above is not None
    flat = held._replace(above=None)
    found = [set(b.near(map, map.rest, x, 0.5 * DX).tolist()) for b in (flat, held)]
    assert found[0] == found[1]
    assert sum(asked[1:]) < 0.7 * asked[0]


# the samples' neighbours

def few(x, rng):
    """Three samples anywhere."""
    return rng.choice(len(x), 3, replace=False)


def clustered(x, rng):
    """The six points nearest to one."""
    return np.argsort(np.linalg.norm(x - x[0], axis=1))[:6]


def most(x, rng):
    """All points but a tenth."""
    return rng.choice(len(x), len(x) - len(x) // 10, replace=False)


def every(x, rng):
    """All points."""
    return np.arange(len(x))


@pytest.mark.parametrize("chosen", [few, clustered, most, every])
def test_the_support_is_all_points_that_share_a_node(moved, body, degree, chosen, many):
    (map, xhat), (X, dx), n = moved, body, len(body[0])
    quadrature = lagrangian(X, np.ones(n), np.ones(n), dx, degree)
    x = map.place(X, xhat)
    samples = np.sort(chosen(x, np.random.default_rng(n)))
    expected = np.flatnonzero(sharing(x, x[samples], dx, degree))
    assert np.array_equal(quadrature.support(map, xhat, samples), expected)
    assert len(samples) < len(expected) or chosen is every
    assert len(expected) < n or chosen is not clustered


def test_the_cloud_is_the_support_with_its_masses(moved, d, degree, rng):
    (map, xhat), X, samples = moved, cloud(d, 300), np.array([7, 40, 41])
    m, V0 = rng.uniform(1.0, 2.0, (2, 300))
    quadrature = lagrangian(X, m, V0, DX, degree)
    at = quadrature.support(map, xhat, samples)
    found = quadrature.cloud(map, xhat, samples)
    whole = zip((found.points.points, found.m, found.V0), (X, m, V0), strict=True)
    assert all(np.array_equal(a, b[at]) for a, b in whole)
    assert found.report == {"points": len(at)}


# samples

GROUPS = (np.arange(10, 22), np.arange(18, 40), np.array([60, 62, 64]))


@pytest.mark.parametrize("count", [15, 16, 50, 99, 100])
def test_a_draw_is_of_the_count_with_enough_of_every_group(count):
    chosen = draw(100, count, 12, 3, GROUPS)
    for k in range(50):
        found = chosen(np.random.default_rng(k))
        assert len(found) == count
        assert np.array_equal(found, np.unique(found))
        assert 0 <= found[0] <= found[-1] < 100
        for group in GROUPS:
            assert len(np.intersect1d(found, group)) >= min(PER_GROUP, len(group))


def test_all_points_need_no_draw():
    assert np.array_equal(draw(40, 40, 6, 2)(np.random.default_rng(0)), np.arange(40))


def test_a_draw_is_that_of_the_generator():
    chosen = draw(100, 20, 6, 2, GROUPS)
    first, again, other = (np.random.default_rng(k) for k in (3, 3, 4))
    found = chosen(first)
    assert np.array_equal(found, chosen(again))
    assert not np.array_equal(found, chosen(other))
    assert not np.array_equal(found, chosen(first))         # step by step other samples


def test_no_point_is_preferred():
    """Counts of 4000 draws within five standard deviations; in a group those forced come first."""
    rng, draws = np.random.default_rng(0), 4000
    plain, grouped = draw(50, 10, 2, 2), draw(50, 10, 2, 2, (np.arange(20, 28),))
    count = np.bincount(np.concatenate([plain(rng) for _ in range(draws)]), minlength=50)
    assert abs(count - 0.2 * draws).max() < 5 * np.sqrt(draws * 0.2 * 0.8)
    count = np.bincount(np.concatenate([grouped(rng) for _ in range(draws)]), minlength=50) / draws
    rest = 5 / 45           # the five that are not forced, of 45
    share = np.where((np.arange(50) >= 20) & (np.arange(50) < 28), 5 / 8 + 3 / 8 * rest, rest)
    assert abs(count - share).max() < 5 * 0.5 / np.sqrt(draws)


@pytest.mark.parametrize(("wrong", "said"), [
    ((10, 11, 4, 2), r"11 samples of 10 points: expected 1 \.\. 10$"),
    ((10, 0, 1, 2), r"0 samples of 10 points: expected 1 \.\. 10$"),
    ((10, 3, 7, 2), "for 7 latent coordinates: expected at least 4 samples$"),
    ((100, 12, 6, 3, GROUPS), "for each of 3 kinematic boundaries: expected at least 13$"),
        ((20, 15, 6, 3, GROUPS), r"names a point outside 0 \.\. 19$"),
])
def test_impossible_samples_are_refused(wrong, said):
    with pytest.raises(ValueError, match=said):
        draw(*wrong)


def test_just_enough_samples_are_taken():
    rng = np.random.default_rng(0)
    assert len(draw(10, 4, 7, 2)(rng)) == 4
    assert len(draw(100, 15, 6, 3, (*GROUPS, []))(rng)) == 15     # nobody at a boundary
