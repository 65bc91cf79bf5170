import math

import pytest
from model_runs import ModelRuns, search_of
from sweep_scenes import FLIGHT

from mpm_ref.sweep.setting import setting
from validation.trade import scenes
from validation.trade.scenes import (
    POINTS,
    TradeCase,
    advice_of,
    points_of,
    record_advice,
    searched,
)


class Records:
    def __init__(self):
        self.values, self.bounds, self.notes = {}, {}, {}

    def record(self, target, value, bound=None, note="", **_):
        self.values[target], self.bounds[target], self.notes[target] = value, bound, note


@pytest.fixture
def search():
    search = search_of(ModelRuns())
    search.run()
    return search


def test_an_advice_is_the_best_setting_beside_the_own(search):
    advice, best = advice_of(search, "toy", 3.0), search.best()
    assert advice.setting == best.text
    assert (advice.error, advice.cpu) == (search.error_of(best),
                                          search.observations[best].cost.cpu)
    own = setting(dx=1.0)
    assert (advice.own_error, advice.own_cpu) == (search.error_of(own),
                                                  search.observations[own].cost.cpu)
    assert (advice.wall, advice.same) == (3.0, True)


def test_another_scene_written_is_noticed(search, monkeypatch):
    monkeypatch.setattr(scenes, "best_scene", lambda search, name: FLIGHT)
    assert not advice_of(search, "toy", 3.0).same


def test_without_an_advice_there_is_no_error():
    search = search_of(ModelRuns(order=0.2))
    search.run()
    advice = advice_of(search, "toy", 3.0)
    assert advice.setting == ""
    assert math.isnan(advice.error)


def test_points_are_all_settings(search):
    points = [dict(zip(POINTS, row, strict=True)) for row in points_of(search, "toy")]
    assert len(points) == len(search.settings())
    best, = (point for point in points if point["best"])
    assert best["front"]
    assert best["setting"] == search.best().text


def test_records_judge_the_time_and_the_advice(search):
    advice = advice_of(search, "toy", 3.0)
    records, case = Records(), TradeCase("toy", "", "5min")
    record_advice(records, case, [advice, advice._replace(same=False),
                                  advice._replace(setting="", wall=4.0)])
    base = "trade.scenes.toy"
    assert (records.values[f"{base}.wall"], records.bounds[f"{base}.wall"]) == (10.0, 1200.0)
    assert records.values[f"{base}.advised"] == 2
    assert records.values[f"{base}.changed"] == 1
    assert "none" in records.notes[f"{base}.advised"]


def test_a_scene_is_searched_twice_with_the_same_runs(tmp_path, monkeypatch):
    (tmp_path / "flight.toml").write_text(FLIGHT)
    monkeypatch.setattr(scenes, "WORKERS", 1)
    advice, points = searched(TradeCase(str(tmp_path / "flight.toml"), "", "6s"))
    assert [row[1] for row in advice] == [0.05, 0.01]
    first = {(row[2], row[5]) for row in points if row[1] == 0.05 and row[3] == "finished"}
    second = {(row[2], row[5]) for row in points if row[1] == 0.01 and row[3] == "finished"}
    assert first
    assert first & second
