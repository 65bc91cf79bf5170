"""What of a run is seen by a training, and the states that come of it."""

import numpy as np
import pytest

from mpm_ref.trajectories import Observed
from validation.nclaw.observation import (
    OFF,
    Observation,
    affine,
    frames,
    from_positions,
    observe,
    parabolas,
    points,
    weights,
)

DT, STEPS = 1e-3, 60
LINEAR = np.array([[1.2, 0.3, 0.0], [0.0, 0.9, -0.2], [0.1, 0.0, 1.1]])


@pytest.fixture
def run():
    """A run that affinely strains and flies, `Observed`: x = (1 + t A) X + t v."""
    X = np.random.default_rng(0).random((50, 3))
    A, v = LINEAR - np.eye(3), np.array([0.3, -1.0, 0.2])
    t = DT * np.arange(STEPS + 1)
    F = np.eye(3) + t[:, None, None] * A
    x = np.einsum("kij,pj->kpi", F, X) + t[:, None, None] * v
    V = np.broadcast_to(X @ A.T + v, x.shape)
    L = A @ np.linalg.inv(F)
    full = (len(t), len(X), 3, 3)
    return Observed(x, V.copy(), np.broadcast_to(L[:, None], full).copy(),
                    np.broadcast_to(F[:, None], full).copy())


@pytest.mark.parametrize(("seen", "levels"), [(Observation(), range(61)), (Observation(every=20),
                                                                           [0, 20, 40, 60]),
                                              (Observation(gap=40), [*range(11), *range(50, 61)]),
                                              (Observation(every=7, gap=20), [0, 7, 14, 42, 49,
                                                                              56]),
                                              (Observation(gap=1000), [0])])
def test_frames_are_every_so_many_steps_but_for_a_gap(seen, levels):
    assert frames(seen, STEPS).tolist() == [*levels]


def test_a_share_of_the_points_is_seen(rng):
    mask = points(Observation(share=0.3), 50, rng)
    assert mask.sum() == 15
    assert points(Observation(share=1e-9), 50, rng).sum() == 1
    assert points(Observation(), 50, rng).all()


def test_what_counts_counts_one_on_average():
    mask = np.array([True, False, True])
    weight = weights(np.array([0, 2, 4]), mask, 4)
    assert weight[1:].mean() == pytest.approx(1.0)
    assert (weight > 0.0).tolist() == [[k % 2 == 0 and a for a in mask] for k in range(5)]
    assert len(set(weight[weight > 0.0])) == 1


def test_a_run_that_is_seen_in_whole_is_the_run(run):
    found, weight = observe(Observation(), run, DT)
    assert all(map(np.array_equal, found, run))
    assert (weight == 1.0).all()
    assert Observation().complete
    assert not Observation(noise=1e-9).complete


def test_between_frames_nothing_is_known(run):
    found, weight = observe(Observation(every=5), run, DT)
    for own, true in zip(found, run, strict=True):
        assert np.array_equal(own[::5], true[::5])
        assert np.isnan(np.delete(own, np.s_[::5], axis=0)).all()
    assert not weight[1::5].any()


def test_noise_is_in_positions_alone_and_not_at_the_start(run):
    found, _ = observe(Observation(noise=1e-3), run, DT)
    off = found.x - run.x
    assert not off[0].any()
    assert np.std(off[1:]) == pytest.approx(1e-3, rel=0.05)
    assert all(map(np.array_equal, found[1:], run[1:]))


def test_outliers_are_few_and_far(run):
    found, _ = observe(Observation(outliers=0.05), run, DT)
    far = np.linalg.norm(found.x - run.x, axis=2)
    assert far[far > 0.0] == pytest.approx(OFF)
    assert np.mean(far[1:] > 0.0) == pytest.approx(0.05, rel=0.3)


def test_points_that_are_not_seen_keep_their_true_states(run):
    found, weight = observe(Observation(share=0.3, noise=1e-3), run, DT)
    hidden = ~weight.any(axis=0)
    assert hidden.sum() == 35
    assert np.array_equal(found.x[:, hidden], run.x[:, hidden])


def test_the_same_seed_sees_the_same(run):
    one, again, other = (observe(Observation(noise=1e-3, share=0.5), run, DT, seed)
                         for seed in (1, 1, 2))
    assert np.array_equal(one[0].x, again[0].x)
    assert np.array_equal(one[1], again[1])
    assert not np.array_equal(one[1], other[1])


@pytest.mark.parametrize("seen", [Observation(positions=True), Observation(positions=True, every=5),
                                  Observation(positions=True, share=0.5)])
def test_affine_motion_is_known_from_positions(run, seen):
    found, weight = observe(seen, run, DT)
    levels = np.flatnonzero(weight.any(axis=1))
    for own, true in zip(found, run, strict=True):
        assert own[levels] == pytest.approx(true[levels], abs=1e-9)


def test_states_come_from_the_points_that_are_seen(run):
    """Others may be anywhere, but at the start, where all is known."""
    mask = np.arange(50) < 25
    x = run.x.copy()
    x[1:, ~mask] = 7.0
    found = from_positions(x, mask, DT * np.arange(STEPS + 1), run.v[0])
    assert found.F == pytest.approx(run.F, abs=1e-9)
    assert found.x == pytest.approx(run.x, abs=1e-9)


def test_parabolas_do_not_reach_across_a_gap():
    t = DT * np.array([*range(20), *range(40, 60)])
    x = np.where(t < 0.03, t, 5.0 - t)[:, None, None] * np.ones((1, 1, 3))
    found, v = parabolas(x, t, np.ones((1, 3)))
    assert found == pytest.approx(x, abs=1e-12)
    assert v[:20] == pytest.approx(1.0)
    assert v[20:] == pytest.approx(-1.0)


def test_parabolas_average_noise_out(rng):
    x = 1e-3 * rng.normal(size=(200, 30, 3))
    found, _ = parabolas(x, DT * np.arange(200), np.zeros((30, 3)))
    assert np.std(found[10:-10]) < 0.6e-3


def test_short_stretches_of_frames_are_fitted_too():
    t = DT * np.array([0, 1, 10, 20, 21])
    x = (2.0 * t)[:, None, None] * np.ones((1, 1, 3))
    found, v = parabolas(x, t, 2.0 * np.ones((1, 3)))
    assert found == pytest.approx(x)
    assert np.isfinite(v).all()


def test_affine_maps_fit_best(rng):
    Y, X = rng.random((4, 9, 3)), rng.random((4, 3))
    y = Y @ LINEAR.T + 0.5
    at, gradient = affine(Y, X, y[None])
    assert at[0] == pytest.approx(X @ LINEAR.T + 0.5)
    assert gradient[0] == pytest.approx(np.broadcast_to(LINEAR, (4, 3, 3)))
