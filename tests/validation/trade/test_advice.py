from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from model_runs import ModelRuns, search_of
from sweep_scenes import FLIGHT, observed_run, scene_of

from mpm_ref.scene import build
from mpm_ref.sweep.observation import RunCost
from mpm_ref.sweep.setting import setting
from validation.trade import advice
from validation.trade.advice import NONE, RIGHT, UNKNOWN, WRONG, AdviceCase, record_cases
from validation.trade.advice_scenes import (
    TUNED,
    advice_scenes,
    column_positions,
    fly,
    hang,
    release,
    toss,
)


def test_scenes_are_sound_and_have_distinct_names():
    scenes = advice_scenes()
    assert len({one.name for one in scenes}) == len(scenes) == 24
    for one in scenes:
        assert len(build(one.scene).bodies[0].id) >= 40
    judged = [one for one in scenes if one.name not in TUNED]
    assert sum(len(one.quantities) for one in judged) * len(advice.ERRORS) >= 100


def test_released_column_starts_at_rest_and_swings_about_its_static_state():
    X = np.stack((np.zeros(9), np.linspace(0.0, 0.8, 9)), axis=1)
    c = np.sqrt(1e6 * 0.7 / (1.3 * 0.4) / 1000.0)
    t = np.array([0.0, 2.0 * 0.8 / c, 4.0 * 0.8 / c])
    u = column_positions(t, X)[..., 1] - X[:, 1]
    static = -9.8 / c**2 * (0.8 * X[:, 1] - 0.5 * X[:, 1] ** 2)
    assert u[0] == pytest.approx(0.0, abs=1e-8)
    assert u[1] == pytest.approx(2.0 * static, abs=1e-8)
    assert u[2] == pytest.approx(0.0, abs=1e-8)


def test_released_column_obeys_the_wave_equation():
    c2, h, y, t = 1e6 * 0.7 / (1.3 * 0.4) / 1000.0, 2e-3, 0.1, 0.004

    def u(t, y):
        return column_positions(np.array([t]), np.array([[0.0, y]]))[0, 0, 1] - y

    tt = (u(t + h / 40, y) - 2 * u(t, y) + u(t - h / 40, y)) / (h / 40) ** 2
    yy = (u(t, y + h) - 2 * u(t, y) + u(t, y - h)) / h**2
    assert tt == pytest.approx(c2 * yy - 9.8, abs=0.05)


def test_flight_keeps_its_energy():
    t, X = np.array([0.0, 0.2]), np.array([[0.5, 0.7]])
    exact = fly(t, X)
    mass = 1000.0 * np.pi * 0.25**2
    height = exact["positions"][:, 1]
    total = exact["kinetic"][:, 0] + mass * 9.8 * height
    assert total[0] == pytest.approx(total[1])


def test_a_toss_keeps_its_energy():
    t, X = np.array([0.0, 0.25]), np.array([[0.2, 0.15, 0.15]])
    exact = toss(t, X)
    height = exact["positions"][:, 2]
    total = exact["kinetic"][:, 0] + 36.0 * 9.8 * height
    assert total[0] == pytest.approx(total[1])
    assert exact["kinetic"][0, 0] == pytest.approx(0.5 * 36.0 * 13.0)
    assert exact["positions"][1, 0] - 0.2 == pytest.approx(0.5)
    assert exact["front:x+"][1, 0] - 0.4 == pytest.approx(0.5)


def test_a_hanging_column_is_a_standing_one_that_is_mirrored():
    t, y = np.array([0.0, 0.01]), np.linspace(0.0, 0.6, 5)
    X = np.stack((np.zeros(5), y), axis=1)
    ours = hang(t, X)["positions"].reshape(2, 5, 2)[..., 1]
    standing = release(t, X[::-1], H=0.6)["positions"].reshape(2, 5, 2)[..., 1]
    assert ours[0] == pytest.approx(y, abs=1e-9)
    assert ours - y == pytest.approx(standing - y[::-1], abs=1e-9)
    assert (ours[1, :4] < y[:4]).all()
    assert hang(t, X)["front:y-"][1, 0] == ours[1, 0]


class Records:
    def __init__(self):
        self.values, self.notes = {}, {}

    def record(self, target, value, note="", **_):
        self.values[target], self.notes[target] = value, note


def case(status, cpu=1.0, least=1.0):
    return AdviceCase("s", "positions", 0.01, 1.0, "dx x 1", 0.005, 0.02, 0.001, cpu, least, "",
                      status)


@pytest.fixture
def pair():
    """A search, and one that knows the truth and has a cheaper setting that keeps the error."""
    search, truth = search_of(ModelRuns()), search_of(ModelRuns(), error=1e-9)
    search.run()
    truth.start()
    truth.refine()
    truth.observations |= search.observations
    best = search.best()
    run = search.observations[best]
    cheap = replace(run, cost=replace(run.cost, cpu=run.cost.cpu / 4.0))
    truth.observations[setting(dx=0.25, degree=1)] = cheap
    return search, truth


def test_the_least_is_the_cheapest_that_keeps_the_error(pair):
    search, truth = pair
    least = advice.least_of(search, truth)
    assert least == setting(dx=0.25, degree=1)
    assert advice.true_error(least, search, truth) <= search.error
    truth.observations[setting(dx=0.125, degree=1)] = replace(
        truth.observations[least], cost=replace(truth.observations[least].cost, cpu=1e-9))
    assert advice.least_of(search, truth) == least      # finer than a search may use
    assert advice.settings_to_time(search, truth) == (search.best(), least)


def test_a_case_takes_the_times_that_were_measured_in_turn(pair):
    search, truth = pair
    least, best = advice.least_of(search, truth), search.best()
    one = advice.case_of("toy", search, truth, {best: 3.0, least: 2.0})
    assert (one.status, one.cpu, one.least, one.cheapest) == (RIGHT, 3.0, 2.0, least.text)
    truth.observations = {best: search.observations[best]}
    assert advice.least_of(search, truth) == best
    assert advice.settings_to_time(search, truth) == ()
    one = advice.case_of("toy", search, truth, {})
    assert one.cpu == one.least == search.observations[best].cost.cpu


def test_times_are_medians_of_runs_in_turn(monkeypatch):
    order, times = [], iter([0.1, 9.0, 0.3, 0.2, 0.5, 0.4])

    def made(run):
        order.append(run.scene)
        return SimpleNamespace(cost=RunCost(cpu=next(times)))
    monkeypatch.setattr(advice, "observe", made)
    settings = [setting(dx=1.0), setting(dx=2.0)]
    scene = scene_of(FLIGHT)
    cpu = advice.timed_in_turn(scene, observed_run(scene), settings)
    assert cpu == {settings[0]: 0.3, settings[1]: 9.0}      # one long run is enough
    assert len(order) == 5 + 1
    assert order[0] != order[1]


def test_records_count_what_was_judged():
    records = Records()
    cases = [case(RIGHT, 3.0), case(RIGHT), case(RIGHT, 2.0), case(WRONG), case(NONE),
             case(UNKNOWN)]
    record_cases(records, cases, judged=True)
    record_cases(records, cases[:1], judged=False)
    assert records.values["trade.advice.judged"] == 4
    assert records.values["trade.advice.right"] == 0.75
    assert records.values["trade.advice.cost"] == 2.0
    assert records.values["trade.advice.dear"] == pytest.approx(2 / 3)
    assert records.values["trade.advice.tuned.judged"] == 1
    assert "s positions 0.01: 0.02" in records.notes["trade.advice.right"]
