import numpy as np
import pytest

from mpm_ref.scene import build
from validation.trade import advice
from validation.trade.advice import NONE, RIGHT, UNKNOWN, WRONG, AdviceCase, record_cases
from validation.trade.advice_scenes import TUNED, advice_scenes, column_positions, fly


def test_scenes_are_sound_and_have_distinct_names():
    scenes = advice_scenes()
    assert len({one.name for one in scenes}) == len(scenes) == 12
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


class Records:
    def __init__(self):
        self.values, self.notes = {}, {}

    def record(self, target, value, note="", **_):
        self.values[target], self.notes[target] = value, note


def case(status, cpu=1.0, least=1.0):
    return AdviceCase("s", "positions", 0.01, 1.0, "dx x 1", 0.005, 0.02, 0.001, cpu, least, "",
                      status)


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
