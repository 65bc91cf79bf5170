"""The words of an answer: sentences of directions, lines of tolerances and of pairs, the figure."""

import pytest

from mpm_ref.limits.answer import (
    BUDGET_END,
    LAST_RUNG,
    MARGIN,
    answer_lines,
    map_lines,
    nearest,
    sentence,
    tolerance_lines,
    unresolved_lines,
    wrong_text,
)
from mpm_ref.limits.cause import RESOLUTION, VANISHING
from mpm_ref.limits.figure import draw_limits
from mpm_ref.limits.verdict import AT_COARSE, AT_FINE, LOST, RIGHT, WRONG
from mpm_ref.sweep.observation import REFUSED


def cell(outcome, limit="", **more):
    return {"outcome": outcome, "message": "it was so", "error": 0.3, "tolerance": 0.2,
            "quantity": "positions", "reference": AT_FINE, "limit": limit, "coarse_error": 0.5,
            "share": 1.0, "alone": "", "warnings": (), "factors": {}, "text": "", **more}


def direction(good=1.0, bad=None, end=MARGIN, axis="stiffness", **more):
    factors = [f for f in (good, bad, more.get("late")) if f not in (None, 1.0)]
    facts = {"axis": axis, "text": "the stiffness", "good": good, "bad": bad, "end": end,
             "margin": max(good, 1.0 / good), "direction": "up" if factors[0] > 1.0 else "down",
             "verb": "grow" if factors[0] > 1.0 else "fall", "now": "E = 1",
             "compared_with": AT_FINE, "late": None, "late_cell": None,
             "first_bad": bad and cell(REFUSED)}
    values = {f"{key}_value": None if facts[key] is None else f"E = {facts[key]:g}"
              for key in ("good", "bad")}
    facts |= values | more
    return facts | {"sentence": sentence(facts)}


@pytest.mark.parametrize(("facts", "words"), [
    (direction(10.0, 11.0), "the stiffness may grow 10 times (E = 10); at 11 times (E = 11): "
     "refused: it was so"),
    (direction(10.0, 11.0, compared_with=AT_COARSE), "the stiffness may grow 10 times (E = 10) "
     "(compared with itself at 2 dx alone); at 11 times (E = 11): refused: it was so"),
    (direction(0.1, 0.05), "the stiffness may be divided by 10 (E = 0.1); divided by 20 "
     "(E = 0.05): refused: it was so"),
    (direction(bad=0.1, end=BUDGET_END), "the stiffness divided by 10 (E = 0.1): refused: it was "
     "so (nothing nearer was tried within the budget)"),
    (direction(bad=1.07), "the stiffness at 1.07 times (E = 1.07): refused: it was so (nothing "
     "nearer was tried)"),
    (direction(0.001, end=LAST_RUNG), "the stiffness may be divided by 1000 (E = 0.001), as far as "
     "was tried"),
    (direction(10.0, 20.0, BUDGET_END), "the stiffness may grow 10 times (E = 10); at 20 times "
     "(E = 20): refused: it was so (the budget ended the search between them)"),
    (direction(10.0, end=BUDGET_END, late=100.0, late_value="E = 100"),
     "the stiffness may grow 10 times (E = 10); the budget ended the search"),
    (direction(end=BUDGET_END, late=0.1, late_value="E = 0.1", late_cell=cell(
        WRONG, reference=AT_COARSE)), "the stiffness divided by 10 (E = 0.1): 30 % off in "
     "positions (tolerance 20 %), beside itself at 2 dx; the budget ended before dx/2 could "
     "decide"),
    (direction(end=BUDGET_END, late=0.1), "the stiffness: whether it may fall was not tried within "
     "the budget"),
    (direction(14.0, end=LAST_RUNG, axis="poisson", verb="fall", good_value="nu = -0.9",
               now="nu = 0.4"), "the stiffness may fall to nu = -0.9 (from nu = 0.4), as far as "
     "was tried (no scene has one below -1, and none below -0.9 is tried)"),
    (direction(bad=14.0, axis="poisson", bad_value="nu = -0.9"), "the stiffness at nu = -0.9: "
     "refused: it was so (nothing nearer was tried)"),
])
def test_a_sentence_says_how_a_factor_changes_the_scene(facts, words):
    assert sentence(facts) == words


def test_a_milder_failure_is_nearest_only_where_there_is_no_other():
    mild = [direction(bad=1.2, first_bad=cell(WRONG, VANISHING)),
            direction(bad=1.3, first_bad=cell(LOST))]
    wrong = direction(bad=900.0, good=800.0, first_bad=cell(WRONG, RESOLUTION))
    assert nearest([*mild, wrong]) is wrong
    assert nearest(mild) is mild[0]


def test_a_vanishing_quantity_is_told_by_its_change_in_the_scene_as_given():
    text = wrong_text(cell(WRONG, VANISHING, error=50.0, share=1e-4, quantity="impulse:plate"))
    assert text == ("(vanishing quantity): impulse:plate nearly vanishes here (at dx/2 it has 0.01 "
                    "% of its change in the scene as given), so that its relative error means "
                    "little: it is 0.5 % of that change off")


def tolerances(**shares):
    return tolerance_lines({"tolerance": shares, "error": 0.05, "slack": 2.0})


def test_a_wider_tolerance_than_asked_has_its_reason():
    assert tolerances(a=0.05, b=0.05) == ["what counts as right: a within 5 %, b within 5 %, the "
                                          "error asked"]
    line, = tolerances(a=0.05, b=0.3)
    assert line == ("what counts as right: a within 5 %, b within 30 %, not the 5 % asked (of b): "
                    "the scene as given differs from itself at dx/2 by 15 %, and 2 times that is "
                    "allowed; a smaller dx asks for more")
    assert "asked: the scene" in tolerances(a=0.4, b=0.3)[0]


def test_an_unresolved_quantity_is_the_first_that_is_said():
    assert unresolved_lines({"tolerance": {"a": 0.6, "b": 0.3}, "error": 0.05}) == [
        "warning: the grid of the scene as given does not resolve a: a run counts as right within "
        "60 %, so that right and wrong mean little"]
    assert unresolved_lines({"tolerance": {"a": 0.6}, "error": 0.6}) == []
    lines = answer_lines(FACTS | {"maps": [], "tolerance": {"a": 0.6}, "warnings": []})
    assert "does not resolve a" in lines[0]


FACTS = {
    "warnings": [],
    "wrong": [], "limits": {}, "cells": [], "nearest": None, "left_out": {}, "complete": True,
    "title": "", "scene": "toy", "tolerance": {"positions": 0.2}, "error": 0.01, "slack": 2.0,
    "directions": [direction(10.0, end=LAST_RUNG), direction(0.1, end=BUDGET_END)]}


def pair_map(*outcomes):
    """A map of two factors beside 1 with the pairs' outcomes: REFUSED is known by one axis."""
    singles = [cell(outcome, factors={axis: 2.0}) for axis, outcome in
               (("stiffness", RIGHT), ("density", RIGHT))]
    pairs = [cell(outcome, factors={"stiffness": 2.0, "density": 2.0 + k}, text=f"pair {k}",
                  alone="density" * (outcome == REFUSED)) for k, outcome in enumerate(outcomes)]
    pairs = [{"factors": one["factors"], "outcome": None} if one["outcome"] is None else one
             for one in pairs]
    return {"axes": ["stiffness", "density"], "cells": [[cell(RIGHT), *singles, *pairs]]}


@pytest.mark.parametrize(("outcomes", "words"), [
    ((RIGHT, RIGHT), "2 of 2 pairs right"),
    ((WRONG, RIGHT), "1 of 2 pairs right; fails only together: pair 0"),
    ((REFUSED, None, None), "no pair was judged; 1 refused by the density alone, not counted; 2 "
     "not run within the budget"),
    ((RIGHT, REFUSED, REFUSED), "1 of 1 pairs right; 2 refused by the density alone, not counted"),
])
def test_only_pairs_that_were_judged_are_counted(outcomes, words):
    assert map_lines({"maps": [pair_map(*outcomes)]}) == [f"stiffness and density: {words}"]


def test_warnings_of_the_scene_and_of_right_cells_stand_first():
    warned = cell(RIGHT, warnings=("dispersion: waves",), factors={"density": 2.0}, text="density")
    facts = FACTS | {"maps": [], "warnings": ["gap: wide"], "cells": [warned, warned]}
    assert answer_lines(facts)[:2] == [
        "warning: the scene as given: gap: wide",
        "right with a warning of the run: 2 cells, such as density: dispersion: waves"]


def test_the_nearest_failure_is_that_of_the_nearest_bad_factor():
    far = direction(good=1.0, bad=10.0, first_bad=cell(WRONG, RESOLUTION))
    near = direction(good=1.9, bad=2.0, first_bad=cell(WRONG, RESOLUTION))
    assert nearest([far, near]) is near


def test_the_tolerance_stands_before_the_margins():
    lines = answer_lines(FACTS | {"maps": []})
    assert lines.index(tolerance_lines(FACTS)[0]) < lines.index(FACTS["directions"][0]["sentence"])


def test_signs_of_bars_stand_in_the_legend():
    figure = draw_limits(FACTS | {"maps": []})
    assert [text.get_text() for text in figure.axes[0].texts] == ["10 +", "10 ?"]
    assert {"the budget ended the search", "not tried farther"} <= {
        text.get_text() for text in figure.legends[0].texts}
