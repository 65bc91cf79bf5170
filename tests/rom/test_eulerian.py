"""Quadrature points of the grid's cells: where they lie, where they come from, what they carry."""

from itertools import product
from math import pi
from typing import NamedTuple

import numpy as np
import pytest
from rom_toys import affine, cloud, decoder

from mpm_ref.core.spline import STENCILS, base_of
from mpm_ref.rom.fields.affine import Affine
from mpm_ref.rom.kinematics import ITERATIONS, guesses, guesses_by_cell, preimages, shorten
from mpm_ref.rom.quadrature.eulerian import Eulerian

DX, RHO = 0.125, 700.0
RADIUS = 0.45           # of the disk or ball that is the body, around the middle of the unit box


@pytest.fixture(params=(2, 3), ids=("quadratic", "cubic"))
def degree(request):
    """Of the splines."""
    return request.param


def distance(X):
    """Signed distance from the surface of the body at rest [m]."""
    return np.linalg.norm(X - 0.5, axis=1) - RADIUS


def inside(X):
    """Whether points are within the body at rest."""
    return distance(X) <= 0.0


def body(d, degree=2, per_cell=2, dx=DX):
    """Quadrature of the body, with a few hundred material points."""
    X = cloud(d, 600)
    X = X[inside(X)]
    return Eulerian(X, RHO, distance, X[:40], dx, degree, per_cell)


def bent(d, k=0):
    """A learned map, and latent coordinates."""
    return decoder(d, 3), np.random.default_rng(k).uniform(-1.0, 1.0, 3)


# where they lie

def nodes(x, degree):
    """The nodes that a coordinate reaches on one axis."""
    stencil = STENCILS[degree]
    return {int(base_of(x, DX, stencil)) + k for k in stencil}


def around(sample, degree, per_cell):
    """Midpoints of sub-cells that share a node with one sample, in half sub-cells: odd integers.
    Those of six cells to either side are tried, axis by axis.
    """
    half, axes = DX / (2 * per_cell), []
    for a in sample:
        first = 2 * per_cell * (int(np.floor(a / DX)) - 6) + 1
        tried = range(first, first + 2 * per_cell * 13, 2)
        axes.append([k for k in tried if nodes(k * half, degree) & nodes(a, degree)])
        assert tried[0] < axes[-1][0]
        assert axes[-1][-1] < tried[-1]
    return set(product(*axes))


@pytest.mark.parametrize("per_cell", [1, 2, 3, 4])
def test_places_are_all_midpoints_that_share_a_node_with_a_sample(d, degree, per_cell, rng):
    samples = rng.uniform(-0.15, 0.15, (3, d))
    samples[1] = np.round(samples[1] / DX) * DX             # on a node
    samples[2] = (np.round(samples[2] / DX) + 0.5) * DX     # in the middle of a cell
    found = body(d, degree, per_cell).places(samples) / DX * 2 * per_cell
    number = np.rint(found).astype(int)
    assert abs(found - number).max() < 1e-12
    assert len(np.unique(number, axis=0)) == len(number)
    expected = set().union(*[around(sample, degree, per_cell) for sample in samples])
    assert set(map(tuple, number.tolist())) == expected


# where they come from

@pytest.mark.parametrize("far", [False, True], ids=("from guesses", "from the middle"))
def test_there_and_back(d, far):
    """From the middle of the body the first steps are as long as allowed."""
    (map, xhat), X = bent(d), cloud(d, 300)
    x = map.place(X, xhat)
    start = np.full((300, d), 0.5) if far else guesses(map, xhat, x, cloud(d, 3, seed=1))
    back = preimages(map, xhat, x, start, DX)
    assert back.converged.all()
    assert abs(back.points.points - X).max() < 1e-8 * DX
    assert abs(start - X).max() > 1e-3
    assert (5 if far else 1) <= back.iterations < 0.5 * ITERATIONS


def test_guesses_are_not_changed_and_good_ones_are_kept(d):
    (map, xhat), X = bent(d), cloud(d, 20)
    start = X.copy()
    back = preimages(map, xhat, map.place(X, xhat), start, DX)
    assert back.iterations == 0
    assert np.array_equal(back.points.points, X)
    moved = X + 0.05
    kept = moved.copy()
    preimages(map, xhat, map.place(X, xhat), moved, DX)
    assert np.array_equal(moved, kept)


def test_a_guess_is_the_nearest_seed_carried_by_its_gradient(d):
    """Exact for affine maps from any seed; a seed's own position leads back to the seed."""
    (map, xhat), X, seeds = affine(d), cloud(d, 100), cloud(d, 3, seed=1)
    assert abs(guesses(map, xhat, map.place(X, xhat), seeds) - X).max() < 1e-13
    map, xhat = bent(d)
    assert abs(guesses(map, xhat, map.place(seeds, xhat), seeds) - seeds).max() < 1e-13
    step = np.full((3, d), 1e-3)
    x = map.place(seeds, xhat) + step
    F = map.derivatives(seeds, xhat)[1]
    expected = seeds + np.array([np.linalg.inv(F_s) @ a for F_s, a in zip(F, step, strict=True)])
    assert abs(guesses(map, xhat, x, seeds) - expected).max() < 1e-13


class Fold(NamedTuple):
    """x_0 = X_0^2, the other axes stay: nothing is mapped to x_0 < 0, and F is singular at 0."""

    dim: int
    r = 0

    def place(self, X, xhat):
        return self.derivatives(X, xhat)[0]

    def derivatives(self, X, xhat):
        x, F = X.copy(), np.tile(np.eye(self.dim), (len(X), 1, 1))
        x[:, 0], F[:, 0, 0] = X[:, 0] ** 2, 2.0 * X[:, 0]
        return x, F, np.zeros((*X.shape, 0))


def test_what_has_no_preimage_is_not_found(d, rng):
    """Positions on both sides of a fold, in one batch: X is right wherever it counts as found."""
    n = 200
    x = rng.uniform(0.1, 1.0, (n, d)) * np.where(np.arange(n) % 3 == 0, -1.0, 1.0)[:, None]
    start = rng.uniform(0.1, 1.0, (n, d)) * rng.choice((-1.0, 1.0), (n, 1))
    back = preimages(Fold(d), None, x, start, 10.0 * DX)
    assert np.array_equal(back.converged, x[:, 0] > 0.0)
    at = Fold(d).place(back.points.points, None)
    assert np.linalg.norm(at - x, axis=1)[back.converged].max() <= 1e-8 * DX
    assert (np.sign(back.points.points[:, 0]) == np.sign(start[:, 0]))[back.converged].all()
    assert back.iterations == ITERATIONS


def test_from_a_point_with_a_singular_gradient_nothing_is_found(d, rng):
    """Such points drop out; those beside them go on."""
    x = rng.uniform(0.2, 1.0, (30, d))
    start = rng.uniform(0.2, 1.0, (30, d))
    start[::4, 0] = 0.0
    back = preimages(Fold(d), None, x, start, DX)
    assert np.array_equal(back.converged, start[:, 0] != 0.0)
    flat = Affine(d).rest
    flat[0] = 0.0
    assert not preimages(Affine(d), flat, x, start, DX).converged.any()


def test_steps_are_cut_to_a_length_and_keep_their_direction(d, rng):
    step = rng.normal(size=(50, d))
    step[0], length = 0.0, np.linalg.norm(step, axis=1)
    cut = shorten(step, 1.0)
    assert np.array_equal(cut[length <= 1.0], step[length <= 1.0])
    assert np.linalg.norm(cut[length > 1.0], axis=1) == pytest.approx(1.0, rel=1e-14)
    assert np.allclose(cut * np.maximum(length, 1.0)[:, None], step, rtol=1e-14, atol=0.0)


def test_what_is_known_of_a_preimage_is_of_the_point_found(d):
    """However far it is from the place: x, F and dg/dxhat belong to X, not to the place."""
    (map, xhat), X = bent(d), cloud(d, 200)
    x, near = map.place(X, xhat), X + np.random.default_rng(3).uniform(-2e-2, 2e-2, X.shape)
    for close in (1e-9, 1e-3, 0.3):
        back = preimages(map, xhat, x, near, DX, close)
        assert back.converged.all()
        assert np.linalg.norm(back.points.x - x, axis=1).max() <= close * DX
        once_more = map.derivatives(back.points.points, xhat)
        for known, again in zip(back.points[1:], once_more, strict=True):
            assert abs(known - again).max() < 1e-13
    assert back.iterations == 0
    assert np.array_equal(back.points.points, near)


def test_guesses_from_the_middles_of_cells_are_near(d):
    """Exact for affine maps; else an error of second order in the cell's size."""
    def off(map, xhat, half):
        X = cloud(d, 40)[:, None] + half * np.array(list(product((-1.0, 1.0), repeat=d)))
        x = map.place(X.reshape(-1, d), xhat).reshape(X.shape)
        start = guesses(map, xhat, x.mean(axis=1), cloud(d, 3, seed=1))
        return abs(guesses_by_cell(map, xhat, x, start, cloud(d, 3, seed=1), DX) - X).max()

    assert off(*affine(d), 0.1) < 1e-13
    coarse, fine = (off(*bent(d), half) for half in (0.08, 0.02))
    assert fine < 0.1 * coarse < 0.02


def test_where_a_middle_is_lost_its_points_are_guessed_from_the_seeds(d, rng):
    """A cell across the fold: the middle has no preimage, half of its points have."""
    x = rng.uniform(0.3, 0.5, (2, 4, d))
    x[1, :, 0] = (-0.4, -0.2, 0.05, 0.1)
    seeds = rng.uniform(0.2, 1.0, (5, d))
    found = guesses_by_cell(Fold(d), None, x, np.full((2, d), 0.5), seeds, 10.0 * DX)
    assert np.array_equal(found[1], guesses(Fold(d), None, x[1], seeds))
    assert not np.allclose(found[0], guesses(Fold(d), None, x[0], seeds))


# what they carry

def carried(quadrature, map, xhat):
    """`cloud` with all material points as samples."""
    return quadrature.cloud(map, xhat, np.arange(len(quadrature.X)))


def test_points_outside_the_body_carry_nothing(d, degree):
    (map, xhat), quadrature = bent(d), body(d, degree)
    at, m, V0, _, said, _ = carried(quadrature, map, xhat)
    places = quadrature.places(map.place(quadrature.X, xhat))
    X, J = at.points, np.linalg.det(map.derivatives(at.points, xhat)[1])
    assert inside(X).all()
    assert V0 * J == pytest.approx((DX / 2) ** d, rel=1e-13)
    assert m == pytest.approx(RHO * V0, rel=1e-15)
    assert said["points"] == len(X)
    assert said["outside"] > 0
    assert sum(said[name] for name in ("points", "far", "outside", "lost")) == len(places)
    back = {tuple(k) for k in np.rint(map.place(X, xhat) / DX * 4).astype(int)}
    assert len(back) == len(X)
    assert back <= {tuple(k) for k in np.rint(places / DX * 4).astype(int)}


def test_no_place_in_the_body_is_left_out(d):
    """The inverse of an affine map is known: all places whose preimage is in the body have mass."""
    (map, xhat), quadrature = affine(d), body(d)
    rows = xhat.reshape(d, d + 1)
    A, b = rows[:, :d], rows[:, d]
    origin = (quadrature.places(map.place(quadrature.X, xhat)) - b) @ np.linalg.inv(A).T
    found = carried(quadrature, map, xhat)
    assert abs(found.points.points - origin[inside(origin)]).max() < 1e-12
    assert found.report["lost"] == 0


def test_what_cannot_be_traced_back_is_lost():
    """Beyond a fold there are places that no point is mapped to; `cloud` says so."""
    X = 0.2 + 0.2 * cloud(2, 50)
    quadrature = Eulerian(X, RHO, lambda X: np.where(X[:, 0] > 0.0, -1.0, 0.5 * DX), X[:9], DX, 2)
    at, _, _, _, said, _ = quadrature.cloud(Fold(2), np.zeros(0), np.arange(50))
    places = quadrature.places(Fold(2).place(X, None))
    assert said["lost"] == (places[:, 0] < 0.0).sum() > 0
    assert said["points"] + said["lost"] == len(places)
    assert said["outside"] == said["far"] == 0
    assert (at.points[:, 0] > 0.0).all()


def mass_errors(d, per_cell):
    """Relative errors of the body's mass for some latent coordinates, and their expected size.

    The sub-cells that the surface cuts count as a whole or not at all: N = area / side^(d-1)
    errors of side^d / sqrt(12), of either sign.
    """
    dx = DX if d == 2 else 1.6 * DX
    volume, area = ((pi * RADIUS**2, 2 * pi * RADIUS) if d == 2 else
                    (4 / 3 * pi * RADIUS**3, 4 * pi * RADIUS**2))
    off = [carried(body(d, 2, per_cell, dx), *bent(d, k)).m.sum() / (RHO * volume) - 1.0
           for k in range(4)]
    side = dx / per_cell
    return np.array(off), np.sqrt(area / side ** (d - 1) / 12) * side**d / volume


def test_the_mass_is_that_of_the_body_up_to_an_error_that_falls_with_per_cell(d):
    found = {per_cell: mass_errors(d, per_cell) for per_cell in (1, 2, 4)}
    assert all(abs(off).max() < 3 * size for off, size in found.values())
    assert found[4][1] < 0.01
    assert abs(found[4][0]).max() < 0.3 * abs(found[1][0]).max()
