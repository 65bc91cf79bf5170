"""The cost model of `trade.reduced-size`: fits give back what they are fitted to, and sizes are
those at which costs cross.
"""

import numpy as np
import pytest

from validation.trade.arm import draws
from validation.trade.reduced_size import size_needed
from validation.trade.size_model import (
    STATES,
    GridError,
    PowerLaw,
    Reach,
    Rivals,
    RunCost,
    StepCost,
    first_size,
    fit_grid_error,
    fit_power,
    fit_reach,
    fit_step,
    fit_tried,
)
from validation.trade.size_timing import carried_models, small_models, steppers

N = np.array([12640.0, 42960.0, 101120.0])
FULL = StepCost(0.0, 2e-7, 0.0)


def rivals(**changes):
    full = RunCost(FULL, 5.0)
    return Rivals(full, full, 0.0, GridError(0.8, 1.0), {}, 0.1)._replace(**changes)


def test_windows_of_samples_do_not_count_a_point_twice():
    reach = Reach(50, 5.0, 0.75)
    assert reach.count(1e12) == pytest.approx(50 * 1000, rel=2e-3)
    assert reach.count(2e3) == pytest.approx(2e3, rel=1e-3)
    assert (np.diff(reach.count(N)) > 0.0).all()


def test_reaches_are_fitted_to_counts():
    points, tried = Reach(50, 5.0, 0.7), Reach(50, 9.0, 0.7)
    found = fit_reach(N, points.count(N), 50)
    assert found.loss == pytest.approx(0.7, abs=0.01)
    assert fit_tried(N, tried.count(N), found).width == pytest.approx(9.0, abs=0.05)


def test_costs_are_fitted_to_times():
    reach, tried = Reach(50, 5.0, 0.7), Reach(50, 9.0, 0.7)
    expected = StepCost(1e-3, 2e-6, 1e-6, reach, tried)
    assert fit_step(N, expected.seconds(N), reach, tried)[:3] == pytest.approx(expected[:3])
    assert fit_step(N, FULL.seconds(N))[:3] == pytest.approx(FULL[:3], abs=1e-12)


def test_a_run_on_a_coarser_grid_has_fewer_and_longer_steps():
    """Without anything read: c^3 fewer particles and c fewer steps."""
    run = RunCost(FULL, 5.0)
    assert run.seconds(8e4) == pytest.approx(16.0 * run._replace(coarser=2.0).seconds(8e4))
    assert run._replace(read=1e-6).seconds(1e5) - run.seconds(1e5) == pytest.approx(STATES * 0.1)


def test_errors_of_coarser_grids_are_fitted_and_inverted():
    law = GridError(0.8, 0.9)
    c, dx = np.meshgrid([1.25, 2.0, 4.0], [0.02, 0.01])
    found, left = fit_grid_error(c.ravel(), dx.ravel(), law.of(c, dx).ravel())
    assert found == pytest.approx(law, rel=1e-4)
    assert left < 1e-4
    assert law.coarsest(law.of(3.0, 0.01), 0.01) == pytest.approx(3.0)
    assert fit_power(N, PowerLaw(2.0, -0.3).of(N)) == pytest.approx((2.0, -0.3))


def test_the_first_size_is_the_one_from_which_on_a_gain_stays():
    sizes = np.array([1.0, 2.0, 3.0, 4.0])
    assert first_size(sizes, np.array([2.0, 0.5, 1.0, 3.0]), 1.0) == 3.0
    assert first_size(sizes, np.array([2.0, 2.0, 2.0, 2.0]), 1.0) == 1.0
    assert first_size(sizes, np.array([2.0, 2.0, 2.0, 0.9]), 1.0) == np.inf


def test_the_cheapest_rival_is_the_coarsest_grid_within_the_error():
    one = rivals()
    c = one.error.coarsest(0.02, np.cbrt(one.volume / 1e6))
    assert one.cheapest(1e6, 0.02) == pytest.approx(one.full.seconds(1e6 / c**3))
    assert one.cheapest(1e6, 0.02, False) == pytest.approx(one.full.seconds(1e6))


def test_a_constant_step_is_cheaper_than_the_full_run_but_not_than_a_coarse_one():
    """A step of 0.1 s costs as much as 5e5 particles; the coarse run's steps do not grow at all."""
    model = RunCost(StepCost(0.1, 0.0, 0.0), 5.0)
    found = size_needed("pod.few", 0.05, rivals(), model)
    assert found.equal_full == pytest.approx(5e5, rel=0.03)
    assert found.gain_full == pytest.approx(2.5e6, rel=0.03)
    assert (found.equal, found.gain, found.equal_steps) == (np.inf, np.inf, np.inf)
    assert found.best < 1.0
    assert found.rival_limit > rivals().cheapest(1e9, 0.05)


def test_carried_models_step_as_full_runs_do():
    """Points and candidates are all those of a body smaller than the windows."""
    mu, (test,) = draws(6, 1, 0)
    small = small_models(mu, 0.06)
    models = carried_models(small, 0.05)
    X = models.pod.X
    assert models.pod.U.shape == (len(X), 3, small.pod.r)
    found = {name: step() for name, step in steppers(models, test, 0.05).items()}
    assert {step.points for step in found.values()} == {len(X)}
    assert found["pod.few"].candidates == found["nsf.few"].candidates == len(X)
    assert found["pod.all"].samples == found["full.apic"].samples == len(X)
    assert found["pod.few"].samples == 50
