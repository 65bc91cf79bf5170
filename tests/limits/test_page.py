"""The page of an answer holds its facts, the words of the terminal, and the figure's colours."""

import json
from types import SimpleNamespace

import numpy as np
import pytest
from offline_page import HOSTILE, assert_holds

from mpm_ref.cli.terminal import as_json
from mpm_ref.limits.answer import answer_lines, answer_of
from mpm_ref.limits.cell import CellScenes
from mpm_ref.limits.figure import COLOURS
from mpm_ref.limits.page import page_facts
from mpm_ref.limits.search import LimitsSearch
from mpm_ref.limits.verdict import (
    AT_COARSE,
    AT_FINE,
    OUTCOMES,
    RIGHT,
    UNCHECKED,
    WRONG,
    CellVerdict,
)
from mpm_ref.scene import loads
from mpm_ref.store.page import page_of
from mpm_ref.sweep.observation import (
    FINISHED,
    REFUSED,
    STOPPED,
    UNSTABLE,
    RunCost,
    RunObservation,
)

SCENE = """
dim = 2
dx = 0.1
dt = 0.001
end = 1.0
gravity = [0.0, -9.8]
[[body]]
name = "block"
density = 1000.0
shape = { type = "box", lower = [0.0, 0.0], upper = [1.0, 1.0] }
velocity = { linear = [1.0, 0.0] }
sampling = { type = "regular", per_cell = 2 }
material = { law = "hencky", E = 1e5, nu = 0.3, flow = { type = "von_mises", sigma_y = 1e4 } }
"""
PROBES = (("block", np.array([[0.0, 0.0], [1.0, 1.0]])),)


class SyntheticJudge:
    """Verdicts by formulas of the factors, with messages that a page must not take as markup."""

    def __init__(self, most=10**9):
        self.scenes, self.quantities = CellScenes(loads(SCENE), PROBES), ("positions",)
        self.error, self.cpu, self.tolerance = 0.01, 80.0, {"positions": 0.02}
        self.base = {1.0: RunObservation({}, RunCost(1.0, 1.0, 10, 4, 1), FINISHED)}
        self.runs = SimpleNamespace(workers=1)
        self.verdicts, self.most, self.coarse = {(): self.verdict({})}, most, {}

    def judge(self, cells, by_fine_grids=False):
        for cell in cells:
            if cell not in self.verdicts and len(self.verdicts) < self.most:
                self.verdicts[cell] = self.verdict(dict(cell))
        return {cell: self.verdicts.get(cell) for cell in cells}

    def refused_alone(self, cell):
        return None

    def verdict(self, factors):
        get = lambda name: factors.get(name, 1.0)       # noqa: E731
        step = get("time_step") * (get("stiffness") / get("density")) ** 0.5
        if step > 1.9:
            return CellVerdict(REFUSED, f"dt = 0.002: past the stable time step {HOSTILE}")
        if get("yield") < 0.05 or get("size") > 50.0:
            return CellVerdict(UNSTABLE, "the energy grew", cpu=0.7, steps=31, until=0.3)
        if get("particles") > 1.5:
            return CellVerdict(STOPPED, "too long", cpu=20.0, steps=100, until=0.1)
        if get("size") < 0.02:
            return CellVerdict(UNCHECKED, "the reference at dx/2: unstable: why", cpu=1.0)
        error = 0.004 * get("speed") * get("gravity") ** 0.5
        outcome, text = (RIGHT, AT_COARSE) if error <= 0.02 else (WRONG, AT_FINE)
        return CellVerdict(outcome, "", error, 0.02, "positions", text, 1.0, 1000, 1.0)


def facts_of(most=10**9):
    search = LimitsSearch(SyntheticJudge(most))
    search.run()
    return answer_of(search, loads(f'title = "{HOSTILE}"\n{SCENE}'), HOSTILE)


@pytest.mark.parametrize("most", [10**9, 30])
def test_the_page_holds_the_facts_and_loads_nothing(most):
    facts = json.loads(as_json(page_facts(facts_of(most))))
    assert_holds(page_of(facts, "limits"), facts)


def test_words_of_the_page_are_those_of_the_terminal():
    facts = facts_of()
    page, lines = page_facts(facts), answer_lines(facts)
    words = [*page["nearest_lines"], *page["wrong_lines"], *page["tolerance_lines"], *page["lines"],
             *(one["line"] for one in page["maps"]), *(one["sentence"] for one in
                                                       page["directions"])]
    assert page["nearest_lines"] == [f"nearest failure: {facts['nearest']['sentence']}"]
    assert sorted(words) == sorted(line for line in lines if line)


def test_every_outcome_has_a_colour_and_a_mark_of_its_own():
    shown = page_facts(facts_of())["outcomes"]
    assert {one["outcome"] for one in shown} == {*OUTCOMES, None}
    assert {one["outcome"]: one["colour"] for one in shown} == COLOURS
    assert len({one["mark"] for one in shown}) == len(shown)


def test_directions_say_how_they_end():
    ends = {(one["axis"], one["direction"]): (one["outcome"], one["ends"], one["reason"])
            for one in page_facts(facts_of())["directions"]}
    assert ends["time_step", "up"][:2] == (REFUSED, "refused")
    assert ends["time_step", "up"][2].startswith("refused: dt = 0.002: past the stable time step")
    assert ends["speed", "up"][:2] == (WRONG, "finished and wrong")
    assert ends["particles", "up"][:2] == (STOPPED, "too long")
    assert ends["size", "down"][:2] == (UNCHECKED, "not checked")
    assert ends["speed", "down"] == (RIGHT, "right as far as was tried", "")


def test_a_direction_that_the_budget_ended_has_no_outcome():
    late = [one for one in page_facts(facts_of(30))["directions"] if one["end"] == "budget"]
    assert late
    assert {(one["outcome"], one["ends"]) for one in late} == {
        (None, "the budget ended the search")}


def test_poissons_ratio_is_told_by_its_values():
    """Its factors are those of 1 - 2 nu, which grows where nu falls."""
    sentences = {one["direction"]: one["sentence"] for one in facts_of()["directions"]
                 if one["axis"] == "poisson"}
    assert sentences["down"] == ("Poisson's ratio may grow to nu = 0.4998 (from nu = 0.3) "
                                 "(compared with itself at 2 dx alone), as far as was tried")
    assert sentences["up"].startswith("Poisson's ratio may fall ")
    verbs = {(one["axis"], one["direction"]): one["verb"] for one in facts_of()["directions"]}
    assert (verbs["poisson", "up"], verbs["poisson", "down"]) == ("fall", "grow")
    assert (verbs["speed", "up"], verbs["speed", "down"]) == ("grow", "fall")
