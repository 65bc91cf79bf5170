"""The cost model of `trade.reduced-size`: fits give back what they are fitted to, and sizes are
those at which costs cross.
"""

import numpy as np
import pytest

from validation.trade import reduced_size
from validation.trade.arm import draws
from validation.trade.reduced_size import size_needed
from validation.trade.size_model import (
    STATES,
    ArmRunCost,
    GridError,
    PowerLaw,
    Rivals,
    StepCost,
    Windows,
    first_size,
    fit_grid_error,
    fit_power,
    fit_step,
    fit_tried,
    fit_windows,
    last_size,
)
from validation.trade.size_timing import carried_models, small_models, steppers

N = np.array([12640.0, 42960.0, 101120.0])
FULL = StepCost(0.0, 2e-7, 0.0)


def rivals(**changes):
    full = ArmRunCost(FULL, 5.0)
    return Rivals(full, full, 0.0, GridError(0.8, 1.0), {}, 0.1)._replace(**changes)


def test_windows_of_samples_do_not_count_a_point_twice():
    windows = Windows(50, 5.0, 0.75)
    assert windows.count(1e12) == pytest.approx(50 * 1000, rel=2e-3)
    assert windows.count(2e3) == pytest.approx(2e3, rel=1e-3)
    assert (np.diff(windows.count(N)) > 0.0).all()


def test_reaches_are_fitted_to_counts():
    points, tried = Windows(50, 5.0, 0.7), Windows(50, 9.0, 0.7)
    found = fit_windows(N, points.count(N), 50)
    assert found.loss == pytest.approx(0.7, abs=0.01)
    assert fit_tried(N, tried.count(N), found).width == pytest.approx(9.0, abs=0.05)


def test_costs_are_fitted_to_times():
    windows, tried = Windows(50, 5.0, 0.7), Windows(50, 9.0, 0.7)
    expected = StepCost(1e-3, 2e-6, 1e-6, windows, tried)
    assert fit_step(N, expected.seconds(N), windows, tried)[:3] == pytest.approx(expected[:3])
    assert fit_step(N, FULL.seconds(N))[:3] == pytest.approx(FULL[:3], abs=1e-12)


def test_a_run_on_a_coarser_grid_has_fewer_and_longer_steps():
    """Without anything read: c^3 fewer particles and c fewer steps."""
    run = ArmRunCost(FULL, 5.0)
    assert run.seconds(8e4) == pytest.approx(16.0 * run._replace(coarser=2.0).seconds(8e4))
    assert run._replace(read=1e-6).seconds(1e5) - run.seconds(1e5) == pytest.approx(STATES * 0.1)


def test_errors_of_coarser_grids_are_fitted_and_inverted():
    law = GridError(0.8, 0.9)
    c, dx = np.meshgrid([1.25, 2.0, 4.0], [0.02, 0.01])
    found, left = fit_grid_error(c.ravel(), dx.ravel(), law.value(c, dx).ravel())
    assert found == pytest.approx(law, rel=1e-4)
    assert left < 1e-4
    assert law.coarsest(law.value(3.0, 0.01), 0.01) == pytest.approx(3.0)
    assert fit_power(N, PowerLaw(2.0, -0.3).value(N)) == pytest.approx((2.0, -0.3))


def test_the_first_size_is_the_one_from_which_on_a_gain_stays():
    sizes = np.array([1.0, 2.0, 3.0, 4.0])
    assert first_size(sizes, np.array([2.0, 0.5, 1.0, 3.0]), 1.0) == 3.0
    assert first_size(sizes, np.array([2.0, 2.0, 2.0, 2.0]), 1.0) == 1.0
    assert first_size(sizes, np.array([2.0, 2.0, 2.0, 0.9]), 1.0) == np.inf
    assert last_size(sizes, np.array([2.0, 0.5, 2.0, 0.9]), 1.0) == 3.0
    assert last_size(sizes, np.array([0.2, 0.5, 0.2, 0.9]), 1.0) == 0.0


def test_the_cheapest_rival_is_the_coarsest_grid_within_the_error():
    one = rivals()
    c = one.error.coarsest(0.02, np.cbrt(one.volume / 1e6))
    assert one.cheapest(1e6, 0.02) == pytest.approx(one.full.seconds(1e6 / c**3))
    assert one.cheapest(1e6, 0.02, False) == pytest.approx(one.full.seconds(1e6))


def test_a_constant_step_is_cheaper_than_the_full_run_but_not_than_a_coarse_one():
    """A step of 0.1 s costs as much as 5e5 particles; the coarse run's steps do not grow at all."""
    model = ArmRunCost(StepCost(0.1, 0.0, 0.0), 5.0)
    found = size_needed("pod.few", 0.05, rivals(), model)
    assert found.equal_full == pytest.approx(5e5, rel=0.03)
    assert found.gain_full == pytest.approx(2.5e6, rel=0.03)
    assert (found.equal, found.gain, found.equal_steps) == (np.inf, np.inf, np.inf)
    assert found.best < 1.0
    assert found.rival_limit > rivals().cheapest(1e9, 0.05)


def test_measured_gains_are_compared_where_they_are_farthest_off(monkeypatch):
    """The full run costs 1e-6 N^(4/3); by half as much and by twice as much at the two sizes."""
    sizes = [8000, 27000]
    predicted = {n: 1e-6 * n ** (4 / 3) for n in sizes}
    methods = ["full.apic", *reduced_size.REDUCED]
    cpu = [(1.0 if name == "full.apic" else off) * predicted[n]
           for n, off in zip(sizes, (1.1, 2.0), strict=True) for name in methods]
    table = {"particles": np.repeat(sizes, len(methods)), "method": np.array(2 * methods),
             "cpu_run": np.array(cpu)}
    recorded, declared = {}, []

    class Results:
        def __init__(self, folder):
            pass

        def table(self, *names):
            return table

    class Run:
        def record(self, target, value, **rule):
            recorded[target] = value, rule

    monkeypatch.setattr(reduced_size, "ProfileResults", Results)
    monkeypatch.setattr(reduced_size, "declare", declared.append)
    full = ArmRunCost(FULL, 5.0)
    reduced_size.record_gains(Run(), rivals(), dict.fromkeys(reduced_size.REDUCED, full))
    value, rule = recorded["trade.reduced-size.nsf.few.gain-measured"]
    assert value == pytest.approx(0.5)
    assert rule["bound"] == (1.0 / 1.3, 1.3)
    assert "0.909 over 1 at 8000 particles; 0.5 over 1 at 27000" in rule["note"]
    assert declared == ["results/standard/trade.reduced.methods.csv"]


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
