"""The tower: its size, and the race of full and reduced models."""

from types import SimpleNamespace

import numpy as np
import pytest

from mpm_ref.reduced.case import case
from mpm_ref.reduced.march import Way
from mpm_ref.rom.affine import Affine
from mpm_ref.scene import build
from validation.ldm import tower
from validation.ldm.studies import TOWER, latin_twice, refined
from validation.verification.scenes import with_

PRINTED = 3076115 * (0.48 / 3) ** 3     # [m^3]: points times volumes (LDM-tab2-sampling, LDM-X8)


@pytest.fixture
def small(monkeypatch):
    """A tower of few points and steps, and a map that is exact for affine motions."""
    affine = SimpleNamespace(decoder=Affine(3), rest=Affine(3).rest)
    monkeypatch.setattr(tower, "trained", lambda name: affine)
    return with_(refined(TOWER.scene(0.7, 0.3, -0.8), 2.88, 2), steps=3)


def test_the_tower_has_the_printed_volume():
    body = build(TOWER.scene(0.7, 0.3, -0.8)).bodies[0]
    assert body.particles.V0.sum() == pytest.approx(PRINTED, rel=0.02)


def test_parameters_are_within_their_ranges_and_fill_them():
    low, high = np.array((0.6, 0.0, -np.pi / 3)), np.array((0.8, np.pi / 2, -np.pi / 6))
    for numbers in (TOWER.train, TOWER.test):
        share = (TOWER.mu[list(numbers)] - low) / (high - low)
        strata = np.sort((share * len(numbers)).astype(int), axis=0)
        assert (strata == np.arange(len(numbers))[:, None]).all()


def test_parameters_are_those_of_scipy():
    qmc = pytest.importorskip("scipy.stats.qmc")
    rng, low, high = np.random.default_rng(5), (0.0, 1.0), (2.0, 1.5)
    expected = [qmc.scale(qmc.LatinHypercube(2, rng=rng).random(n), low, high) for n in (7, 3)]
    assert np.array_equal(latin_twice(((0.0, 2.0), (1.0, 1.5)), 7, 3, 5), np.vstack(expected))


def test_the_top_moves_as_it_is_told():
    _, top = TOWER.scene(0.5, 0.0, -np.pi / 6).fixed
    assert top.motion.translation.rate == pytest.approx((0.5 * np.cos(np.pi / 6), 0.0, -0.25))


def test_a_race_measures_every_way(small):
    ways = [Way("resampled", points=30), Way("eulerian", points=30)]
    wall, found = tower.race(small, ways, 3)
    assert wall > 0.0
    for one, way in zip(found, ways, strict=True):
        assert one.way == way
        assert one.wall > 0.0
        assert 0 < one.points < 20000
        assert 0.0 < one.errors.origin < 0.1


def test_a_run_that_breaks_down_has_no_error(small):
    too_few = Way("resampled", points=2)        # for twelve latent coordinates
    _, (broken, fine) = tower.race(small, [too_few, Way("resampled", points=30)], 2)
    assert broken.errors.origin == np.inf
    assert np.isfinite(fine.errors.origin)


def test_the_fastest_transfer_is_measured(small):
    assert tower.fastest(small) > 0.0


def test_tracked_points_are_in_their_own_order(small):
    full = tower.Full(small)
    start = full.positions(7)
    full.step()
    assert np.array_equal(start, case(small).X[::7])
    assert np.abs(full.positions(7) - start).max() < 0.1
