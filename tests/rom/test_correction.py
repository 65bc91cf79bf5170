"""A coarse run with a learned correction: what it reproduces exactly, how its smoothing is chosen,
and what it refuses.
"""

import numpy as np
import pytest

from mpm_ref.rom import correction
from mpm_ref.rom.correction import carrier, choose_smoothing, fit_correction, ridge_weights


def grids(d, seed=0):
    """Return fine points (n, d) and coarse particles (m, d) of a unit box."""
    rng = np.random.default_rng(seed)
    return rng.uniform(size=(60, d)), rng.uniform(size=(25, d))


@pytest.mark.parametrize("d", [2, 3])
def test_points_are_carried_exactly_by_affine_motions(d):
    X, X_coarse = grids(d)
    one, A = carrier(X, X_coarse), np.random.default_rng(1).normal(size=(d, d))
    assert abs(one.place(X_coarse @ A + 2.0) - (X @ A + 2.0)).max() < 1e-12


@pytest.mark.parametrize("d", [2, 3])
def test_a_linear_error_of_coarse_runs_is_corrected(d):
    """What is missing is a linear function of the coarse state, which states of three motions
    determine: a state of these motions that was not trained on is found.
    """
    X, X_coarse = grids(d)
    rng, one = np.random.default_rng(2), carrier(X, X_coarse)
    motions, missing = rng.normal(size=(3, *X_coarse.shape)), rng.normal(size=(3, *X.shape))
    amounts = rng.normal(size=(8, 3))

    def pair(a):
        x_coarse = X_coarse + np.tensordot(a, motions, 1)
        return one.place(x_coarse) + np.tensordot(a, missing, 1), x_coarse

    x, x_coarse = map(np.array, zip(*map(pair, amounts), strict=True))
    fit = fit_correction(one, x, x_coarse, 3, np.arange(8), 1e-12)
    expected, given = pair(np.array([0.3, -1.2, 0.7]))
    assert abs(fit.place(given) - expected).max() < 1e-8
    assert abs(one.place(given) - expected).max() > 0.1


def test_a_body_at_rest_is_not_corrected():
    X, X_coarse = grids(2)
    one, rng = carrier(X, X_coarse), np.random.default_rng(3)
    x, x_coarse = X + rng.normal(size=(5, *X.shape)), X_coarse + rng.normal(size=(5, 25, 2))
    fit = fit_correction(one, x, x_coarse, 4, np.arange(5), 1e-3)
    assert abs(fit.place(X_coarse) - X).max() < 1e-12


def test_weights_are_those_of_ridge_regression():
    """The dual form equals the solution of the normal equations of the displacements."""
    rng = np.random.default_rng(4)
    states, A, smoothing = rng.normal(size=(12, 5)), rng.normal(size=(12, 2)), 0.1
    lam = smoothing * np.mean(np.sum(states**2, axis=1))
    expected = np.linalg.solve(states.T @ states + lam * np.eye(5), states.T @ A)
    assert np.allclose(states.T @ ridge_weights(states, A, smoothing), expected, rtol=1e-12)


@pytest.mark.parametrize(("noise", "smoothest"), [(0.0, False), (3.0, True)])
def test_noisy_answers_are_smoothed(noise, smoothest):
    rng = np.random.default_rng(5)
    states, runs = rng.normal(size=(24, 40)) / 40**0.5, np.arange(24) // 4
    A = states @ rng.normal(size=(40, 2)) + noise * rng.normal(size=(24, 2))
    chosen = choose_smoothing(states, A, runs)
    assert (chosen == max(correction.SMOOTHING)) == smoothest


def test_smoothing_is_chosen_by_runs_that_are_left_out():
    """Each run has its states twice: leaving out single states would find them again, and choose
    the least smoothing.
    """
    rng = np.random.default_rng(6)
    states, A = rng.normal(size=(10, 30)), rng.normal(size=(10, 1))
    pairs = np.repeat(states, 2, axis=0), np.repeat(A, 2, axis=0)
    assert choose_smoothing(*pairs, np.arange(20)) == min(correction.SMOOTHING)
    assert choose_smoothing(*pairs, np.arange(20) // 2) == max(correction.SMOOTHING)


def test_what_does_not_fit_is_refused():
    X, X_coarse = grids(2)
    one = carrier(X, X_coarse)
    x, x_coarse = np.tile(X, (3, 1, 1)), np.tile(X_coarse, (3, 1, 1))
    with pytest.raises(ValueError, match="2 coarse particles: expected at least 3"):
        carrier(X, X_coarse[:2])
    with pytest.raises(ValueError, match="as many states of each"):
        fit_correction(one, x[:2], x_coarse, 1, np.arange(3), 1e-3)
    with pytest.raises(ValueError, match="not finite"):
        fit_correction(one, x * np.nan, x_coarse, 1, np.arange(3), 1e-3)
    for smoothing in (0.0, -1.0, np.inf):
        with pytest.raises(ValueError, match="expected a positive number"):
            fit_correction(one, x, x_coarse, 1, np.arange(3), smoothing)


def test_choices_without_runs_to_leave_out_are_refused():
    states, A = np.random.default_rng(7).normal(size=(4, 6)), np.ones((4, 1))
    with pytest.raises(ValueError, match="one training run: expected at least two"):
        choose_smoothing(states, A, np.zeros(4))
    with pytest.raises(ValueError, match="no training state has a displacement"):
        choose_smoothing(0.0 * states, A, np.arange(4))


def test_particles_in_a_plane_are_refused():
    """A layer of particles determines no displacement off its plane."""
    X, X_coarse = grids(3)
    layer = X_coarse * np.array([1.0, 1.0, 0.0])
    with pytest.raises(ValueError, match="nearest to 60 of 60 fine points lie in a plane"):
        carrier(X, layer)


def test_a_correction_chooses_its_smoothing_by_runs():
    X, X_coarse = grids(2)
    one, rng = carrier(X, X_coarse), np.random.default_rng(8)
    states, missing = rng.normal(size=(10, *X_coarse.shape)), rng.normal(size=(10, *X.shape))
    x_coarse = np.repeat(X_coarse + states, 2, axis=0)
    x = np.array([one.place(low) for low in x_coarse]) + np.repeat(missing, 2, axis=0)
    pairs = fit_correction(one, x, x_coarse, 3, np.arange(20) // 2)
    single = fit_correction(one, x, x_coarse, 3, np.arange(20))
    assert (pairs.smoothing, single.smoothing) == (max(correction.SMOOTHING),
                                                   min(correction.SMOOTHING))
