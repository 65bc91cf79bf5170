"""Operator inference finds the dynamics that data come from, and refuses what is no data."""

import re

import numpy as np
import pytest

from mpm_ref.rom import inference
from mpm_ref.rom.inference import (
    LatentDynamics,
    NormalEquations,
    features_of,
    fit_dynamics,
    normal_equations,
    numbers_to_try,
)
from mpm_ref.rom.kinematics import NoBody

RUNS, INTERVALS, R, M = 10, 40, 3, 2


def true_dynamics():
    """Damped oscillators that are weakly coupled by products of all kinds."""
    rng = np.random.default_rng(0)
    K = -np.diag([0.1, 0.2, 0.4])
    D, B = -0.3 * np.eye(R), rng.normal(size=(M, R))
    products = [0.01 * rng.normal(size=(n, R)) for n in (R * (R + 1) // 2, R * R, R * M)]
    return LatentDynamics(np.vstack([K, D, B, *products]), 0.0)


def loads(seed, runs=RUNS):
    """Loads that jump now and then."""
    return np.repeat(np.random.default_rng(seed).uniform(-0.3, 0.3, (runs, 8, M)), 5, axis=1)


def runs_of(model, u):
    return np.array([[*model.states(own)] for own in u])


def test_a_quadratic_system_is_found_from_its_runs():
    true, u = true_dynamics(), loads(1)
    a = runs_of(true, u)
    assert np.isfinite(a).all()
    found = normal_equations(a, u).solve(1e-14)
    assert abs(found.operators - true.operators).max() < 1e-6
    fresh = loads(2, 3)
    expected = runs_of(true, fresh)
    fit = fit_dynamics(a, u)
    assert fit.r == R
    assert abs(runs_of(fit, fresh) - expected).max() < 1e-6 * abs(expected).max()


def test_runs_of_many_loads_are_those_of_each():
    true, u = true_dynamics(), loads(1)
    together = np.stack([*true.states(np.moveaxis(u, 1, 0))], axis=1)
    assert abs(together - runs_of(true, u)).max() < 1e-14


def test_coordinates_that_are_noise_are_not_learned():
    """The first two of four; the others are noise, and taken as 0."""
    true, u = true_dynamics(), loads(1, 16)
    a = runs_of(true, u)[..., :2]
    noise = 0.1 * abs(a).max() * np.random.default_rng(6).normal(size=a.shape)
    assert fit_dynamics(np.concatenate([a, noise], axis=2), u).r == 2


def test_coordinates_that_move_are_learned():
    """Fewer of them leave at least the error of taking the others as 0."""
    u = loads(1, 16)
    a = runs_of(true_dynamics(), u)
    assert fit_dynamics(a, u).r == R
    assert fit_dynamics(a, u, r=2).r == 2
    errors = inference.left_out_errors(a, u, np.arange(4), 2, (1e-8,))
    assert errors[0] > np.sum(a[:4, :, 2:] ** 2) > 0.0


def test_the_numbers_of_coordinates_that_are_tried():
    assert [numbers_to_try(R) for R in (1, 2, 5, 10)] == [(1,), (2,), (2, 4, 5), (2, 4, 6, 8, 10)]


def test_a_state_reads_no_load_before_its_interval():
    read = []

    def given():
        for k, u in enumerate(loads(3, 1)[0]):
            read.append(k)
            yield u

    for k, _ in enumerate(true_dynamics().states(given())):
        assert read == [*range(k + 1)]


def test_features_are_of_second_order():
    a, before, u = np.array([2.0, 3.0]), np.array([1.0, 5.0]), np.array([7.0])
    found = features_of(a, before, u, np.triu_indices(2))
    linear, squares = [2.0, 3.0, 1.0, -2.0, 7.0], [4.0, 6.0, 9.0]
    assert found.tolist() == [*linear, *squares, 2.0, -4.0, 3.0, -6.0, 14.0, 21.0]


def test_noise_asks_for_more_smoothing():
    true, u = true_dynamics(), loads(4, 4)
    a = runs_of(true, u)
    noisy = a + 0.05 * abs(a).max() * np.random.default_rng(5).normal(size=a.shape)
    assert fit_dynamics(noisy, u).smoothing > fit_dynamics(a, u).smoothing


def test_a_run_that_explodes_is_stopped_with_a_sentence():
    model = LatentDynamics(np.zeros_like(true_dynamics().operators), 0.0)
    model.operators[:R] = 9.0 * np.eye(R)
    model.operators[R + R] = 1.0
    with pytest.raises(NoBody, match="is the load beyond those of the training runs"):
        [*model.states(np.ones((2000, M)))]


@pytest.mark.parametrize(("change", "sentence"), [
    (lambda a, u: (a[0], u), "expected (runs, intervals, r)"),
    (lambda a, u: (a, u[:, 1:]), "expected (runs, intervals, r)"),
    (lambda a, u: (a[:, :1], u[:, :1]), "runs of one interval"),
    (lambda a, u: (a, u[..., [0, 0]], R, 1e-18), "too small for features that depend on each"),
    (lambda a, u: (a, u, 4), "r = 4: expected a whole number from 1 to 3"),
    (lambda a, u: (a, u, 1.5), "r = 1.5: expected a whole number from 1 to 3"),
    (lambda a, u: (a, u, 2.0), "r = 2.0: expected a whole number from 1 to 3"),
    (lambda a, u: (a * np.nan, u), "leave out runs that broke down"),
    (lambda a, u: (0.0 * a, u), "expected runs that move"),
    (lambda a, u: (a[:1], u[:1]), "one training run: expected at least two"),
    (lambda a, u: (a, u, None, -1.0), "smoothing = -1.0: expected a positive number")])
def test_what_is_no_data_is_refused(change, sentence):
    u = loads(1)
    a, u, *options = change(runs_of(true_dynamics(), u), u)
    options = dict(zip(("r", "smoothing"), options, strict=False))
    with pytest.raises(ValueError, match=re.escape(sentence)):
        fit_dynamics(a, u, **options)


def test_a_smoothing_that_is_too_small_is_not_chosen(monkeypatch):
    u = loads(1)
    a, solve = runs_of(true_dynamics(), u), NormalEquations.solve

    def some_fail(self, smoothing):
        if smoothing < 1e-5:
            raise inference.NotDefinite
        return solve(self, smoothing)

    assert fit_dynamics(a, u).smoothing < 1e-5
    monkeypatch.setattr(NormalEquations, "solve", some_fail)
    assert fit_dynamics(a, u).smoothing >= 1e-5


def test_runs_that_break_down_with_all_smoothings_are_refused(monkeypatch):
    u = loads(1)
    a = runs_of(true_dynamics(), u)
    monkeypatch.setattr(inference, "left_out_errors", lambda *given: np.full(11, np.inf))
    with pytest.raises(ValueError, match="expected more runs, or smaller loads"):
        fit_dynamics(a, u)
