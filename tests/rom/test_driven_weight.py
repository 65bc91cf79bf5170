"""Samples whose velocity is prescribed, and their weight in the projection."""

from itertools import product

import numpy as np
import pytest

from mpm_ref.core.spline import STENCILS, base_of, weights
from mpm_ref.rom.fields.affine import Affine
from mpm_ref.rom.kinematics import evaluate
from mpm_ref.rom.latent import start_state
from mpm_ref.rom.prescribed import prescribed_share, weights_by_share
from mpm_ref.rom.projection import RateProjection
from mpm_ref.rom.study.full_model import ldm_full_model, prescribed_regions
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


def share_of(x, inside, problem):
    """Sum the weights of one point's nodes (in units of dx) that are inside a region."""
    stencil = STENCILS[problem.scheme.degree]
    base = [int(base_of(a, problem.dx, stencil)) for a in x]
    each = [weights(a / problem.dx - b, stencil) for a, b in zip(x, base, strict=True)]
    return sum(np.prod([w[k] for w, k in zip(each, offset, strict=True)])
               for offset in product(stencil, repeat=len(x))
               if inside(problem.dx * (np.array(base) + offset)))


@pytest.mark.parametrize("degree", [1, 2, 3])
def test_share_is_that_of_the_nodes_in_the_regions_of_the_step(degree):
    scene = catalogue_scene("ldm_poke")
    full = ldm_full_model(with_(scene, scheme=with_(scene.scheme, degree=degree)))
    problem, t = full.problem, 0.1
    center = (np.array([-0.1, 0.0, 0.4])
              + (t + problem.clock.dt) * np.array([0.41569219381653056, 0.0, -0.24]))

    def base_or_patch(node):
        return node[2] <= 0.0 or np.linalg.norm(node - center) <= 0.06

    phi = prescribed_share(problem, full.X, t)
    some = np.arange(0, len(full.X), 7)
    expected = [share_of(x, base_or_patch, problem) for x in full.X[some]]
    np.testing.assert_allclose(phi[some], expected, atol=1e-12)
    assert sum(phi > 0.5) > 10
    released = prescribed_share(problem, full.X, 0.25)
    assert not released[full.X[:, 2] > 2.0 * problem.dx].any()
    assert released.any()


def test_nothing_is_prescribed_without_conditions(poke):
    free = with_(catalogue_scene("ldm_poke"), fixed=())
    assert not prescribed_share(ldm_full_model(free).problem, poke.X, 0.0).any()


def test_weights_grow_from_one_to_the_largest():
    w = weights_by_share(np.array([0.0, 0.5, 0.9, 1.0]), 64.0)
    np.testing.assert_allclose(w, [1.0, 1.0 / (0.5 + 0.5 / 64.0), 1.0 / (0.1 + 0.9 / 64.0), 64.0])


def test_weights_are_those_of_the_samples_where_the_body_is(poke):
    map, options = Affine(3), RunOptions(driven_weight=9.0)
    samples, moved = np.arange(0, len(poke.X), 3), map.rest.copy()
    moved[:3] += 0.05
    for xhat in (map.rest, moved):
        w = driven_weights(poke, map, options, samples, (0.0, start_state(xhat)))
        phi = prescribed_share(poke.problem, map.place(poke.X[samples], xhat), 0.0)
        np.testing.assert_array_equal(w, weights_by_share(phi, 9.0))
        assert w.max() > 2.0
    still = 0.0, start_state(map.rest)
    assert driven_weights(poke, map, RunOptions(), samples, still) is None
    high = np.flatnonzero(poke.X[:, 2] > 0.1)
    assert driven_weights(poke, map, options, high, (0.3, still[1])) is None


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
def test_samples_of_a_run_have_weights_of_their_step(poke, samples):
    options = RunOptions(points=200, samples=samples, driven_weight=9.0)
    map = Affine(3)
    sampler = ldm_sampler(poke, map, options, map.rest, 0)
    for t in (0.0, 0.2, 0.3):
        found = sampler(t, start_state(map.rest))
        expected = weights_by_share(prescribed_share(poke.problem, poke.X[found.points], t), 9.0)
        np.testing.assert_allclose(found.weights, expected, rtol=1e-12)
        high = poke.X[found.points, 2] > 0.2
        assert bool(found.weights[high].max() > 1.0) == (t < 0.25)


def test_weight_without_a_prescribed_region_is_refused():
    free = ldm_full_model(with_(catalogue_scene("ldm_gravity"), fixed=()))
    assert not prescribed_regions(free.problem)
    with pytest.raises(ValueError, match="driven_weight = 9: expected 1, since the scene prescr"):
        ldm_model(free, Affine(3), RunOptions(driven_weight=9.0))
