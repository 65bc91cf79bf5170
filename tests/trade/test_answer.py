import json
import re
from dataclasses import replace

import pytest
from model_runs import ModelRuns, search_of
from offline_page import HOSTILE, assert_holds

from mpm_ref.cli.terminal import as_json
from mpm_ref.scene import loads
from mpm_ref.store.page import page_of
from mpm_ref.sweep.difference import difference_so_far
from mpm_ref.sweep.observation import STOPPED, TORN, RunCost, RunObservation
from mpm_ref.sweep.runs import LATE
from mpm_ref.sweep.setting import setting
from mpm_ref.trade.answer import (
    NOT_RUN,
    advice_lines,
    answer_lines,
    answer_of,
    best_scene,
    front_lines,
    is_whole,
    percent,
    shortfalls,
)
from mpm_ref.trade.cost import rounded_up


def facts_of(runs=None, error=0.01):
    search = search_of(runs or ModelRuns(), error)
    search.run()
    return search, json.loads(as_json(answer_of(search, "toy")))


def test_rows_hold_all_settings_and_the_recommended_one():
    search, facts = facts_of()
    assert len(facts["rows"]) == len(search.settings())
    best, = (row for row in facts["rows"] if row["best"])
    assert best["text"] == facts["best"] == search.best().text
    assert best["keeps"]
    assert facts["until"] == facts["end"] == 1.0


def test_front_is_what_no_other_setting_dominates():
    _, facts = facts_of()
    rows = [row for row in facts["rows"] if row["outcome"] == "finished"]
    for row in rows:
        better = [one for one in rows if one["error"] <= row["error"] and one["cpu"] < row["cpu"]]
        assert row["dominated"] == bool(better)
    assert any(not row["dominated"] for row in rows)


def test_words_name_the_setting_its_error_and_cost():
    search, facts = facts_of()
    text = "\n".join(answer_lines(facts))
    assert f"recommended: {search.best().text}: error " in text
    assert "known to" in text
    assert "until t = 1 s" in text


def test_without_an_answer_words_say_what_it_would_take():
    _, facts = facts_of(ModelRuns(order=0.2))
    text = "\n".join(answer_lines(facts))
    assert facts["best"] is None
    assert "no setting keeps 1 %:" in text
    assert "do not approach one solution" in text
    _, facts = facts_of(ModelRuns(left=20.0), error=1e-3)
    text = "\n".join(answer_lines(facts))
    assert re.search(r"a reference of 0\.05 % takes dx = \S+ m", text)


def test_without_a_known_error_the_differences_of_the_grids_are_given():
    search, facts = facts_of(ModelRuns(order=0.2))
    assert facts["until"] == 0.0
    finest = search.observations[setting(dx=search.levels[-1])].values["positions"]
    for row in facts["rows"]:
        chosen = setting(**row["setting"])
        difference = difference_so_far(search.observations[chosen].values["positions"], finest)
        expected = difference[-1] / search.references["positions"].scale[-1]
        assert row["error"] is None
        assert row["error_at_end"] == row["errors_at_end"]["positions"] == pytest.approx(expected)
    head, _, *table = answer_lines(facts)
    assert head == "no error is known; differences from the reference over the whole run:"
    for factor in search.levels:
        shown, = (line for line in table if line.startswith(f"dx x {factor:.4g} "))
        row, = (one for one in facts["rows"] if one["setting"] == {"dx": factor})
        assert f" {percent(row['error_at_end'])} " in shown
    text = "\n".join(answer_lines(facts))
    assert "unknown" not in text
    assert "positions: known to " in text
    assert "on the front" not in text


def test_dominance_without_a_known_error_is_by_differences_until_the_end():
    _, facts = facts_of(ModelRuns(order=0.2))
    for row in facts["rows"]:
        better = [one for one in facts["rows"] if one["error_at_end"] <= row["error_at_end"]
                  and one["cpu"] < row["cpu"]]
        assert row["dominated"] == bool(better)


def test_the_advice_stands_in_the_facts_and_says_what_can_be_asked():
    _, facts = facts_of(ModelRuns(left=20.0), error=1e-3)
    assert facts["advice"] == advice_lines(facts)
    least = rounded_up(facts["references"]["positions"]["least_error"])
    assert f"can be asked now for the whole run: positions at {percent(least)} " in "\n".join(
        facts["advice"])
    _, facts = facts_of(ModelRuns(order=0.0), error=1e-3)
    facts["references"]["positions"]["least_error"] = 1.2
    assert "positions at no error below 100 %" in "\n".join(advice_lines(facts))


def test_the_scene_as_given_is_always_in_the_table():
    for runs in (ModelRuns(), ModelRuns(order=0.2), ModelRuns(left=0.0)):
        _, facts = facts_of(runs)
        lines = [line for line in answer_lines(facts) if "as given" in line]
        assert len(lines) == 1
        assert lines[0].startswith("dx x 1 ")
        assert lines[0].endswith("as given")
    runs.fails = lambda text: text == "dx x 1"
    _, facts = facts_of(runs)
    line, = (line for line in answer_lines(facts) if line.endswith("<- as given"))
    assert "refused" in line


def test_a_bad_start_is_told_beside_the_recommendation_and_in_its_scene():
    search, facts = facts_of()
    assert facts["start_fault"] == ""
    assert not [line for line in answer_lines(facts) if line.startswith("warning")]
    assert "Warning" not in best_scene(search, "toy")
    facts["start_fault"] = "at the start, a face is off"
    assert "warning: at the start, a face is off" in answer_lines(facts)
    text = best_scene(search, "toy", fault=facts["start_fault"])
    assert "\n# Warning: at the start, a face is off.\n" in text
    loads(text)


def test_words_say_until_when_the_errors_of_the_table_hold():
    _, facts = facts_of()
    assert is_whole(facts)
    assert not answer_lines(facts)[0].startswith("errors until")
    runs = ModelRuns()
    runs.chaos = 0.02
    _, facts = facts_of(runs)
    assert not is_whole(facts)
    assert answer_lines(facts)[0] == "errors until t = 0.5 s:"


def test_words_say_what_was_not_tried_and_not_checked():
    search, facts = facts_of()
    text = "\n".join(answer_lines(facts))
    assert "not run within the budget" not in text
    assert "no other transfer" not in text
    late = RunObservation({}, RunCost(cpu=0.0), STOPPED, LATE)
    search.observations[setting(cfl=0.1)] = late
    search.compared_with = None
    facts = json.loads(as_json(answer_of(search, "toy")))
    text = "\n".join(answer_lines(facts))
    assert "1 setting was not run within the budget" in text
    assert [row["outcome"] for row in facts["rows"]].count(NOT_RUN) == 1
    assert "no other transfer was run on a fine grid" in text


def test_words_name_the_reason_that_ends_what_is_known():
    _, facts = facts_of()
    facts["references"]["positions"]["error_at_end"] = 0.001
    assert "the finest grid" in shortfalls(facts)[0]
    assert shortfalls(facts | {"chaos": 0.5}) == ["chaos ends what can be known"]


def test_words_say_why_no_grid_finished():
    runs = ModelRuns()
    runs.fails = lambda text: True
    _, facts = facts_of(runs)
    text = "\n".join(answer_lines(facts))
    assert ("at least two grids must finish with whole bodies, which a larger --budget does not "
            "change; the scene as given: refused: refused") in text


def test_words_say_what_a_grid_that_was_stopped_would_take():
    runs = ModelRuns()
    runs.answers = lambda run: replace(run, outcome=STOPPED, until=0.25, message="stopped",
                                       cost=RunCost(30.0, 30.0, 10, 100, 1))
    _, facts = facts_of(runs)
    assert ("at least two grids must finish; dx x 4 reached t = 0.25 of 1 s in 30 s of CPU time, "
            "so that it takes about 2 min, and the next grid 8 times that") in shortfalls(facts)[0]


def torn_from(dx):
    """Runs whose bodies tear on grids of at most dx times a factor."""
    runs = ModelRuns()
    runs.tears = lambda chosen: chosen.get("dx", 1.0) <= dx
    return runs


def test_torn_grids_are_no_reference_and_torn_settings_are_not_recommended():
    search, facts = facts_of(torn_from(0.25), error=0.05)
    assert search.levels == (4.0, 2.0, 1.0, 0.5)
    torn = [row for row in facts["rows"] if row["outcome"] == TORN]
    assert max(row["setting"]["dx"] for row in torn) == 0.25
    assert torn[0]["message"] == "gap: torn"
    assert not any(row["keeps"] or row["best"] for row in torn)
    assert facts["next_grid"]["obstacle"] == "torn: gap: torn"


def test_words_say_that_bodies_tear_on_all_grids():
    _, facts = facts_of(torn_from(4.0))
    lines = answer_lines(facts)
    assert lines[0] == "warning: the scene as given: gap: torn"
    assert "does not change; the scene as given: torn: gap: torn" in shortfalls(facts)[0]


@pytest.mark.parametrize(("order", "words"), [(1.0, "(extrapolated)"), (0.2, "not extrapolated")])
def test_words_say_whether_the_reference_is_extrapolated(order, words):
    _, facts = facts_of(ModelRuns(order=order))
    assert words in "\n".join(answer_lines(facts))


def test_of_several_quantities_each_row_names_the_one_with_its_error():
    search = search_of(ModelRuns())
    search.quantities = ("positions", "kinetic")
    search.run()
    facts = json.loads(as_json(answer_of(search, "toy")))
    for row in facts["rows"]:
        row["errors"] = {"positions": 1e-3, "kinetic": 2e-3}
    lines = front_lines(facts)
    assert lines[0] == "largest of 2 quantities, with the one that has it:"
    assert len(lines) > 3
    assert all("kinetic" in line and "positions" not in line for line in lines[2:-1])


def test_words_say_until_when_the_advice_holds_and_what_is_known_longer():
    _, facts = facts_of()
    assert "this holds until" not in "\n".join(answer_lines(facts))
    runs = ModelRuns()
    runs.chaos = 0.02
    _, facts = facts_of(runs)
    text = "\n".join(answer_lines(facts))
    assert "from t = 0.625 s on a run perturbed by round-off diverges" in text
    assert "this holds until t = 0.5 s of 1 s" in text
    assert "over the whole run these are known: kinetic to " in text
    facts["references"]["kinetic"]["error_at_end"] = 0.006      # half of 1 % is asked for
    assert "these are known" not in "\n".join(answer_lines(facts))


def test_the_grid_that_it_would_take_is_the_one_that_suffices():
    _, facts = facts_of(ModelRuns(left=20.0), error=6e-3)
    dx = float(re.search(r" % takes dx = (\S+) m", "\n".join(answer_lines(facts)))[1])
    search = search_of(ModelRuns(), 6e-3)
    search.run()
    assert dx == pytest.approx(search.scene.dx * search.levels[-1], rel=2e-3)


def test_the_best_scene_can_be_run_and_says_its_error():
    search, _ = facts_of()
    text = best_scene(search, "toy")
    scene = loads(text)
    assert scene.dx == pytest.approx(0.1 * search.best().get("dx"))
    assert "Expected error" in text
    assert "# Cost: " in text
    search.error = 1e-9
    assert best_scene(search, "toy") is None


def test_the_page_holds_the_facts_and_loads_nothing():
    _, facts = facts_of()
    facts["scene"] = facts["rows"][0]["message"] = HOSTILE
    assert_holds(page_of(facts, "trade"), facts)


@pytest.mark.parametrize("command", ["trade", "limits", "needs"])
def test_a_page_without_javascript_names_the_file_of_its_numbers(command):
    body = page_of({}, command).partition("<body>")[2]
    sentence = re.search(r"<noscript><p>(.*)</p></noscript>", body)[1]
    assert f"<code>.{command}.json</code>" in sentence


def test_a_page_of_a_number_that_is_not_finite_is_refused():
    with pytest.raises(ValueError, match="not JSON compliant"):
        page_of({"error": float("nan")}, "trade")


def test_facts_are_plain_and_finite():
    _, facts = facts_of(ModelRuns(order=0.2))
    json.dumps(facts, allow_nan=False)
