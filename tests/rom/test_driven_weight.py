"""Samples in regions that move, and their weight in the projection."""

import numpy as np
import pytest

from mpm_ref.rom.fields.affine import Affine
from mpm_ref.rom.kinematics import evaluate
from mpm_ref.rom.latent import start_state
from mpm_ref.rom.projection import RateProjection
from mpm_ref.rom.study.full_model import ldm_full_model
from mpm_ref.rom.study.run import RunOptions, ldm_model
from mpm_ref.rom.study.samples import driven_weights, ldm_sampler
from validation.common.scenes import catalogue_scene, with_


class Trial:
    """Trial places and velocities of samples."""

    def __init__(self, x, v):
        self.x, self.v = x, v


@pytest.fixture(scope="module")
def poke():
    return ldm_full_model(catalogue_scene("ldm_poke"))


def test_points_in_the_patch_are_driven_until_it_lets_go(poke):
    driven = poke.driven_points(0.0)
    center = np.array([-0.1, 0.0, 0.4])
    inside = np.linalg.norm(poke.X - center, axis=1) <= 0.06
    np.testing.assert_array_equal(driven, np.flatnonzero(inside))
    assert len(driven) > 10
    assert not len(poke.driven_points(0.3))


def test_weights_are_those_of_driven_samples_alone(poke):
    samples = np.arange(0, len(poke.X), 3)
    w = driven_weights(poke, RunOptions(driven_weight=9.0), samples, 0.0)
    np.testing.assert_array_equal(w > 1.0, np.isin(samples, poke.driven_points(0.0)))
    assert {*w} == {1.0, 9.0}
    assert driven_weights(poke, RunOptions(), samples, 0.0) is None
    assert driven_weights(poke, RunOptions(driven_weight=9.0), samples, 0.3) is None


@pytest.mark.parametrize("kind", ["linear", "nonlinear"])
def test_a_weight_counts_like_repeated_samples(d, kind):
    rng, map = np.random.default_rng(0), Affine(d)
    X, v = rng.normal(size=(20, d)), rng.normal(size=(20, d))
    latent, dt = start_state(map.rest), 0.1
    twice = np.repeat(np.arange(20), np.where(np.arange(20) < 5, 4, 1))

    def fitted(chosen, weights=None):
        samples = evaluate(map, X[chosen], latent.xhat)
        trial = Trial((X + dt * v)[chosen], v[chosen])
        return RateProjection(kind)(map, latent, samples, trial, dt, weights)

    weighted = fitted(np.arange(20), np.where(np.arange(20) < 5, 4.0, 1.0))
    repeated, plain = fitted(twice), fitted(np.arange(20))
    np.testing.assert_allclose(weighted.xhat, repeated.xhat, atol=1e-12)
    np.testing.assert_allclose(weighted.vhat, repeated.vhat, atol=1e-12)
    assert abs(weighted.vhat - plain.vhat).max() > 1e-3
    G, v_chosen = evaluate(map, X, latent.xhat).G, v
    distance = np.sqrt(np.mean(np.sum((G @ weighted.vhat - v_chosen) ** 2, axis=1)))
    assert weighted.fit.residual == pytest.approx(distance)


@pytest.mark.parametrize("samples", ["redrawn", "kept", "pivoted"])
def test_samples_of_a_run_have_weights_while_they_are_driven(poke, samples):
    options = RunOptions(points=200, samples=samples, driven_weight=9.0)
    map = Affine(3)
    sampler = ldm_sampler(poke, map, options, map.rest, 0)
    for t, weighted in ((0.0, True), (0.2, True), (0.3, False)):
        found = sampler(t, start_state(map.rest))
        assert (found.weights is not None) is weighted
        if weighted:
            np.testing.assert_array_equal(found.weights == 9.0,
                                          np.isin(found.points, poke.driven_points(t)))


def test_weight_without_driven_points_is_refused():
    still, map = ldm_full_model(catalogue_scene("ldm_gravity")), Affine(3)
    with pytest.raises(ValueError, match="driven_weight = 9: expected 1, since no point is inside"):
        ldm_model(still, map, RunOptions(driven_weight=9.0))


def test_a_region_that_is_placed_but_fixed_drives_nothing():
    scene = catalogue_scene("ldm_poke")
    base, poke = scene.fixed
    placed = with_(poke, motion=with_(poke.motion, translation=None, center=(0.0, 0.0, 0.0)))
    assert not len(ldm_full_model(with_(scene, fixed=(base, placed))).driven_points(0.0))
