"""Pareto fronts and the bytes of a state."""

from types import SimpleNamespace

import numpy as np
import pytest

from validation.extremes.long_runs import round_state
from validation.trade.explicit import prepare_manufactured
from validation.trade.front import front, record_points, richardson
from validation.trade.measure import (
    DEFAULT,
    QUICK,
    STANDARD,
    MeasuredSetting,
    sample_points,
    settings,
    state_bytes,
)


def point(cpu, error, end="finished", of_bound=0.5):
    return MeasuredSetting("dt", DEFAULT, error, cpu, 100, 1, of_bound, end, "", False)


def test_front_holds_what_no_point_beats():
    costs, errors = [1.0, 2.0, 3.0, 4.0, 0.5], [0.5, 0.2, 0.3, 0.1, np.nan]
    assert front(costs, errors).tolist() == [True, True, False, True, False]


def test_front_of_equal_costs_and_errors_has_one_point():
    assert front([1.0, 1.0, 2.0], [0.5, 0.3, 0.3]).tolist() == [False, True, False]


def test_front_against_its_definition(rng):
    costs, errors = rng.random(60), rng.random(60)
    beaten = [any((costs <= c) & (errors <= e) & ((costs < c) | (errors < e)))
              for c, e in zip(costs, errors, strict=True)]
    assert front(costs, errors).tolist() == [not b for b in beaten]


@pytest.mark.parametrize("p", [1.0, 1.5, 2.0])
def test_richardson_finds_order_and_error_of_a_power_of_dx(p):
    coarse, half, fine = (2.0 + 0.1 * h**p for h in (1.0, 0.5, 0.25))
    order, error = richardson(coarse, half, fine)
    assert order == pytest.approx(p)
    assert error == pytest.approx(0.1 * 0.25**p / fine)


def test_richardson_trusts_no_order_above_two_and_no_values_that_diverge():
    assert richardson(2.0 + 1.0, 2.0 + 0.1, 2.0)[1] == pytest.approx(0.1 / 3.0 / 2.0)
    assert richardson(2.0, 2.1, 2.3)[1] == np.inf
    assert richardson(2.0, 2.1, 2.05)[1] == np.inf


class Run:
    """Records and tables of an experiment."""

    def __init__(self):
        self.experiment, self.records, self.tables = SimpleNamespace(id="trade.x"), {}, {}

    def record(self, target, value, **_):
        self.records[target] = value

    def table(self, name, columns, rows):
        self.tables[name] = [dict(zip(columns, row, strict=True)) for row in rows]


def test_no_unstable_setting_is_on_the_front_and_none_below_the_reference():
    run = Run()
    record_points(run, [point(1.0, 0.001, of_bound=1.2), point(2.0, 0.001), point(3.0, 0.0005)],
                  "", floor=0.002)
    assert run.records["trade.x.reference_error"] == 0.002
    assert [row["pareto_cpu"] for row in run.tables["points"]] == [0, 1, 0]


@pytest.mark.parametrize("levels", [QUICK, STANDARD])
def test_every_level_is_a_scheme_and_differs_from_the_default(levels):
    chosen = [setting for _, setting in settings(levels)]
    assert len(set(chosen)) == len(chosen)
    assert all(setting.scheme for setting in chosen)


@pytest.mark.parametrize("sampling", ["lattice", "jittered", "poisson"])
def test_samplings_have_the_same_number_of_points_in_the_box(sampling):
    X = sample_points(DEFAULT._replace(sampling=sampling), [0.0, -0.25], [1.0, 0.25], 3)
    assert X.shape == (32 * 16, 2)
    assert np.all((X >= [0.0, -0.25]) & (X <= [1.0, 0.25]))


def test_bytes_count_shared_arrays_once_and_f32_half():
    small = DEFAULT._replace(cells=8)
    n = (8 * 2) ** 2
    problem = prepare_manufactured(small).problem
    per_particle = 8 * (2 + 2 + 4 + 4 + 4 + 1 + 1 + 2)          # x v C=L F tau m V0 b
    grid = state_bytes(problem, small) - n * per_particle
    assert 0 < grid < 20**2 * 3 * 8
    halved = state_bytes(problem, small._replace(storage="f32"))
    assert state_bytes(problem, small) - halved == n * 4 * (2 + 2 + 4 + 4 + 4)


def test_rounded_state_is_single_precision():
    problem = prepare_manufactured(DEFAULT._replace(cells=8)).problem
    x = problem.bodies[0].particles.x.copy()
    round_state(problem.bodies)
    rounded = problem.bodies[0].particles.x
    assert np.array_equal(rounded, rounded.astype(np.float32))
    assert not np.array_equal(rounded, x)
