"""What a finer reference would take: prices from measured costs, and whether they are right."""

import json
import re

import pytest
from model_runs import ModelRuns, search_of

from mpm_ref.cli.sweep_options import parse_budget
from mpm_ref.cli.terminal import as_json
from mpm_ref.sweep.setting import setting
from mpm_ref.trade.answer import answer_of, shortfalls
from mpm_ref.trade.cost import budget_text, duration, next_grid_text, price_text, rounded_up

HARD = 1e-3         # an error that the grids within the budget of `short_of` do not know


def short_of(left=20.0, budget=None, **options):
    """Return a search whose budget ended, and its facts."""
    search = search_of(ModelRuns(left=left, **options), HARD)
    search.run()
    return search, json.loads(as_json(answer_of(search, "toy", budget=budget)))


def test_the_next_grid_costs_what_its_run_takes():
    search, facts = short_of()
    finer = setting(dx=search.levels[-1] / 2.0)
    cost = search.runs.run(finer).cost
    assert facts["next_grid"]["dx"] == pytest.approx(search.scene.dx * finer.get("dx"))
    assert facts["next_grid"]["cpu"] == pytest.approx(cost.cpu)
    assert facts["next_grid"]["wall"] == pytest.approx(cost.wall)
    assert price_text(facts, 1) == f"about {duration(cost.cpu)} of CPU time"


def test_more_halvings_cost_all_their_runs():
    search, facts = short_of()
    cpu = sum(search.runs.run(setting(dx=search.levels[-1] / 2.0**k)).cost.cpu for k in (1, 2, 3))
    assert price_text(facts, 3) == f"about {duration(cpu)} of CPU time"


def test_a_budget_that_is_named_runs_the_next_grid():
    search, facts = short_of()
    named = re.search(r"--budget (\S+) runs it", next_grid_text(facts))[1]
    more, _ = short_of(left=parse_budget(named))
    assert more.levels == (*search.levels, search.levels[-1] / 2.0)
    less, _ = short_of(left=0.7 * parse_budget(named))
    assert less.levels == search.levels


def test_what_is_out_of_reach_has_no_budget():
    _, facts = short_of(budget=1e9)
    assert "out of reach" not in "".join(shortfalls(facts))
    cpu = facts["next_grid"]["cpu"]
    text = next_grid_text(facts | {"budget": cpu / 1001.0})
    assert "out of reach (over 1000 times the budget)" in text
    assert "--budget" not in text
    assert "out of reach" not in next_grid_text(facts | {"budget": cpu / 999.0})
    needed = shortfalls(facts | {"budget": cpu / 999.0})[0]
    assert re.search(r"takes dx = \S+ m, about .* of CPU time, which is out of reach", needed)


def test_a_grid_that_is_never_run_is_no_promise():
    _, facts = short_of()
    finer = price_text(facts | {"next_grid": facts["next_grid"] | {"least_dx": 1.0}}, 1)
    assert "this command runs no grid below dx = 1 m" in finer


def test_words_say_why_a_larger_budget_does_not_run_the_next_grid():
    runs = ModelRuns()
    runs.chaos = 0.02
    search = search_of(runs)
    search.run()
    assert search.horizon() > 0.0
    search.finest = 0.0
    facts = answer_of(search, "toy")
    assert next_grid_text(facts).endswith("not run, since 2 grids in turn made no difference")
    runs = ModelRuns()
    runs.fails = lambda text: text == "dx x 0.25"
    search = search_of(runs, HARD)
    search.run()
    assert next_grid_text(answer_of(search, "toy")).endswith(": refused: refused")
    search = search_of(ModelRuns(order=0.2), HARD)
    search.run()
    assert next_grid_text(answer_of(search, "toy")).endswith("this command runs none so fine")


def test_the_least_error_is_the_least_that_is_answered():
    search, facts = short_of()
    assert facts["best"] is None
    least = facts["references"]["positions"]["least_error"]
    for error, known in ((1.001 * least, True), (0.999 * least, False)):
        again = search_of(ModelRuns(left=20.0), error)
        again.run()
        assert again.levels == search.levels
        assert (again.best() is not None and again.horizon() == 1.0) == known


def test_chaos_raises_the_least_error():
    runs = ModelRuns(left=20.0)
    runs.chaos = 0.2
    search = search_of(runs, HARD)
    search.run()
    least = search.least_error("positions")
    again = search_of(runs, 1.001 * least)
    again.run()
    assert again.horizon() == 1.0
    again = search_of(runs, 0.999 * least)
    again.run()
    assert again.horizon() < 1.0


@pytest.mark.parametrize(("seconds", "words"), [
    (0.26, "0.26 s"), (43.0, "43 s"), (690.0, "12 min"), (3.0 * 3600.0, "3 hours"),
    (250.4 * 86400.0, "250 days"), (3.0 * 365.25 * 86400.0, "3 years")])
def test_durations_have_two_digits_and_a_unit(seconds, words):
    assert duration(seconds) == words


@pytest.mark.parametrize("seconds", [0.1, 1.01, 59.0, 119.0, 121.0, 5999.0, 7201.0, 1e5, 123456.0])
def test_budgets_are_read_as_at_least_what_they_name(seconds):
    read = parse_budget(budget_text(seconds))
    assert max(seconds, 1.0) <= read <= 1.11 * max(seconds, 1.0)


@pytest.mark.parametrize(("value", "rounded"), [(0.3767, 0.38), (0.38, 0.38), (1.0, 1.0),
                                                (0.0101, 0.011), (99.1, 100.0), (120.1, 130.0)])
def test_numbers_are_rounded_up_to_two_digits(value, rounded):
    assert rounded_up(value) == pytest.approx(rounded)
