import json

import numpy as np
import pytest
from model_runs import ModelRuns, search_of

from mpm_ref.cli.terminal import as_json
from mpm_ref.store.atomic import NotWritten
from mpm_ref.sweep.observation import RunCost, RunObservation
from mpm_ref.sweep.setting import setting
from mpm_ref.trade.answer import answer_of
from mpm_ref.trade.figure import COSTS, draw_trade, save_figure


def points(axes, label):
    line, = (line for line in axes.lines if line.get_label() == label)
    return np.array(line.get_xydata())


@pytest.fixture
def facts():
    search = search_of(ModelRuns())
    search.run()
    failed = RunObservation({}, RunCost(0.25, 0.25, 3, 100, 1), "unstable")
    search.observations[setting(cfl=0.1)] = failed
    return json.loads(as_json(answer_of(search, "toy")))


def test_each_setting_that_finished_is_a_point(facts):
    finished = [row for row in facts["rows"] if row["outcome"] == "finished"]
    for axes, key in zip(draw_trade(facts).axes, COSTS, strict=True):
        drawn = np.concatenate([points(axes, "front"), points(axes, "dominated")])
        expected = [[row[key], row["error"]] for row in finished]
        assert sorted(drawn.tolist()) == sorted(expected)
        best, = (row for row in finished if row["best"])
        assert points(axes, "recommended") == pytest.approx(np.array([[best[key], best["error"]]]))


def test_the_front_falls_with_the_cost(facts):
    front = points(draw_trade(facts).axes[0], "front")
    front = front[np.argsort(front[:, 0])]
    assert len(front) > 2
    assert (np.diff(front[:, 1]) < 0.0).all()
    expected = [row["error"] for row in facts["rows"] if not row["dominated"]]
    assert sorted(front[:, 1]) == pytest.approx(sorted(expected))


def test_results_files_are_diamonds(facts):
    row = facts["rows"][0] | {"cpu": 1e4, "error": 0.02, "best": False}
    axes = draw_trade(facts | {"compared": [row]}).axes[0]
    assert points(axes, "compared").tolist() == [[1e4, 0.02]]
    assert axes.get_xlim()[1] > 1e4
    assert [1e4, 0.02] not in points(axes, "front").tolist()


def test_failures_are_crosses(facts):
    assert points(draw_trade(facts).axes[0], "failed").tolist() == [[0.25, 1.0]]


def test_a_figure_that_cannot_be_written_is_an_error(facts, tmp_path):
    with pytest.raises(NotWritten):
        save_figure(facts, tmp_path / "none" / "toy.trade.png")


def test_without_a_known_error_differences_from_the_reference_are_drawn():
    search = search_of(ModelRuns(order=0.2))
    search.run()
    facts = json.loads(as_json(answer_of(search, "toy")))
    figure = draw_trade(facts)
    axes = figure.axes[0]
    drawn = np.concatenate([points(axes, "front"), points(axes, "dominated")])
    expected = [[row["cpu"], row["error_at_end"]] for row in facts["rows"] if row["error_at_end"]]
    assert len(expected) == len(facts["rows"]) - 1      # the finest grid is the reference
    assert sorted(drawn.tolist()) == sorted(expected)
    assert axes.get_ylabel() == "difference of positions"
    assert "no error is known" in figure.get_suptitle()


def test_a_figure_of_nothing_says_so():
    runs = ModelRuns()
    runs.fails = lambda text: True
    search = search_of(runs)
    search.run()
    figure = draw_trade(json.loads(as_json(answer_of(search, "toy"))))
    assert "fewer than two grids finished" in figure.get_suptitle()


def test_many_quantities_are_counted_on_the_axis(facts):
    facts["quantities"] = ["positions", "kinetic"]
    assert draw_trade(facts).axes[0].get_ylabel() == "largest error of 2 quantities"


def test_failures_beside_one_setting_are_drawn_without_a_warning(facts, recwarn):
    best, = (row for row in facts["rows"] if row["best"])
    failed = [row | {next(iter(COSTS)): cpu} for cpu in (1e-3, 1e3)
              for row in facts["rows"] if row["error"] is None]
    figure = draw_trade(facts | {"rows": [best, *failed]})
    figure.canvas.draw()
    low, high = figure.axes[0].get_xlim()
    assert low < 1e-3 < 1e3 < high
    assert not recwarn
