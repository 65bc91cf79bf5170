"""The page of an answer: its facts, and verdicts for any change that counts as not required."""

import json
from dataclasses import replace
from math import inf, nan

import msgspec
import pytest
from offline_page import HOSTILE, assert_holds

from mpm_ref.cli.terminal import as_json
from mpm_ref.needs.answer import NeedsAnswer
from mpm_ref.needs.code_parts import CodeParts, table_lines
from mpm_ref.needs.figure import draw_needs
from mpm_ref.needs.ingredients import Removal
from mpm_ref.needs.page import DEARER, page_facts, verdict_cases
from mpm_ref.needs.removal import (
    COSTLY,
    IMPOSSIBLE,
    NOT_REQUIRED,
    REQUIRED,
    UNMEASURED,
    NeedsResult,
    RemovalRun,
    SceneErrors,
)
from mpm_ref.needs.variant import SceneVariant
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

SCENE = f"""
title = "{HOSTILE}"
dim = 2
dx = 0.1
dt = 0.001
end = 1.0
[[body]]
name = "block"
density = 1000.0
shape = {{ type = "box", lower = [0.0, 0.0], upper = [1.0, 1.0] }}
material = {{ law = "hencky", E = 1e5, nu = 0.3 }}
"""
CPU, NOISE, ERROR = 10.0, 0.05, 0.01


def run_of(label, verdict, change=None, cpu=8.0, outcome=FINISHED, message=""):
    changes = {} if change is None else {"positions": change, "kinetic": 0.5 * change}
    return RemovalRun(label, verdict, changes, cpu, outcome, message)


SINGLES = (
    run_of("gravity", REQUIRED, 0.3, 9.0),
    run_of("affine field (PIC instead)", REQUIRED, 0.02, 12.0),
    run_of("friction of collider floor", NOT_REQUIRED, 0.004, 6.0),
    run_of("splines of degree 3 (degree 2 instead)", NOT_REQUIRED, 3e-5, 5.0),
    run_of("collider roof", NOT_REQUIRED, 0.0, 9.5),
    run_of("RPIC damping", COSTLY, 0.006, 13.0),
    run_of("implicit steps (explicit instead)", COSTLY, None, 20.2, STOPPED, "too long"),
    run_of("collider floor", REQUIRED, None, 2.0, UNSTABLE, f"energy grew {HOSTILE}"),
    run_of("body block", IMPOSSIBLE, None, nan, REFUSED, HOSTILE),
    run_of("walls", UNMEASURED, None, 0.0, STOPPED, "not begun"),
)
ORDER = (run_of("collider roof", NOT_REQUIRED, 0.0, 9.5),
         run_of("friction of collider floor", NOT_REQUIRED, 0.004, 6.0),
         run_of("splines of degree 3 (degree 2 instead)", NOT_REQUIRED, 0.0041, 4.0))


def parts_of(multigrid):
    kernels = {"core.transfer_lines.scatter": 1}
    kernels |= {"hot.multigrid.smooth": 2} if multigrid else {}
    return CodeParts(70, {"block": {"F": 32 * 9, "y": 0}}, {"block": 9}, kernels,
                     {"block": "every step"}, multigrid, False)


def answer_of(singles=SINGLES, order=ORDER):
    first = SceneVariant(loads(SCENE), (), (), (0, 1))
    lean = replace(first, removals=(Removal("collider roof", None),))
    base = RunObservation({"positions": None, "kinetic": None}, RunCost(CPU, CPU, 100, 9, 1),
                          FINISHED)
    errors = SceneErrors({"positions": 0.05, "kinetic": 0.03}, 0.5, {"positions": 1e-9})
    result = NeedsResult(first, base, CPU, NOISE, errors, singles, order, lean, False, 7.0)
    return NeedsAnswer(HOSTILE, "mpm-ref needs block", ERROR, result,
                       {"as given": parts_of(True), "lean": parts_of(False)})


@pytest.mark.parametrize("parts", [(SINGLES, ORDER), ((), ())])
def test_the_page_holds_the_facts_and_loads_nothing(parts):
    facts = json.loads(as_json(page_facts(answer_of(*parts))))
    assert_holds(page_of(facts, "needs"), facts)


def test_the_figure_is_drawn_of_any_change_and_name(recwarn):
    """A change without bound, names with dollars and of thousands of characters."""
    singles = (run_of("$\\frac{$", REQUIRED, inf), run_of("x" * 5000, REQUIRED, 1e300),
               run_of("gravity", NOT_REQUIRED, 0.0, nan))
    answer = answer_of(singles)
    scene = msgspec.structs.replace(answer.result.first.scene, title="$x_$" + "y" * 5000)
    errors = replace(answer.result.errors, grid={"positions": inf})
    result = replace(answer.result, errors=errors, first=replace(answer.result.first, scene=scene))
    figure = draw_needs(replace(answer, result=result))
    figure.canvas.draw()
    labels = [label.get_text() for label in figure.axes[0].get_yticklabels()]
    assert labels[0] == r"\$\frac{\$"
    assert max(map(len, labels)) < 70
    assert not recwarn.list


def test_a_line_on_frames_says_that_they_stay():
    label = "frames every 0.1 s (a tenth instead)"
    answer = answer_of((run_of(label, NOT_REQUIRED, 0.004, 6.0), *SINGLES[2:3]))
    first = SceneVariant(loads(SCENE.replace("end =", "interval = 0.1\nend =")), (), (), (0, 1))
    answer = replace(answer, result=replace(answer.result, first=first))
    frames, friction = (one["text"] for one in page_facts(answer)["removals"])
    assert frames == (f"{label}: not required at 1 % (positions by 0.4 %, kinetic by 0.2 %), saves "
                      "40 % of CPU time; the lean scene keeps its frames")
    assert friction.endswith("saves 40 % of CPU time")


def verdict_at(run, x):
    """The verdict that the page shows where a change of at most x counts as not required."""
    cases = verdict_cases(run, answer_of().result)
    return [verdict for least, verdict, _ in cases if least <= x][-1]


@pytest.mark.parametrize("run", SINGLES, ids=lambda run: run.label)
def test_at_the_error_asked_the_page_has_the_measured_verdict(run):
    assert verdict_at(run, ERROR) == run.verdict


def test_verdicts_follow_the_change_that_counts():
    gravity, affine, friction, *_ = SINGLES
    assert [verdict_at(friction, x) for x in (0.0, 0.0039, 0.004, 1.0)] == [
        REQUIRED, REQUIRED, NOT_REQUIRED, NOT_REQUIRED]
    assert [verdict_at(gravity, x) for x in (0.29, 0.3)] == [REQUIRED, NOT_REQUIRED]
    assert verdict_at(affine, 0.02) == COSTLY      # 12 s of 10 s


def test_a_saving_within_the_noise_is_no_cost():
    assert verdict_at(run_of("a", REQUIRED, 0.02, 10.4), 0.02) == NOT_REQUIRED
    assert verdict_at(run_of("a", REQUIRED, 0.02, 10.6), 0.02) == COSTLY


@pytest.mark.parametrize("run", [*SINGLES[6:], run_of("a", REQUIRED, inf)],
                         ids=lambda run: run.label)
def test_verdicts_that_are_no_matter_of_size_stay(run):
    assert {verdict_at(run, x) for x in (0.0, ERROR, 1e9)} == {run.verdict}


def test_words_tell_the_two_kinds_of_cost():
    words = {run.label: verdict_cases(run, answer_of().result)[-1][2] for run in SINGLES}
    assert words["RPIC damping"] == "not required, but takes more CPU time"
    assert words["implicit steps (explicit instead)"] == DEARER
    assert set(words.values()) <= set(page_facts(answer_of())["words"])


def test_lines_are_those_of_the_terminal():
    answer = answer_of()
    facts, lines = page_facts(answer), answer.lines
    assert facts["scene_lines"] == lines[:len(facts["scene_lines"])]
    assert set(facts["lean_lines"]) <= set(lines)
    assert [one["text"] for one in facts["removals"]] == lines[4:14]
    table = table_lines(answer.code)[1:]
    assert len(table) == len(facts["code_rows"])
    for line, (label, texts) in zip(table, facts["code_rows"], strict=True):
        assert line.startswith(label)
        assert line.removeprefix(label).split() == [word for text in texts for word in text.split()]


def test_a_change_below_that_of_another_grid_is_marked():
    notes = {one["label"]: one["grid_note"] for one in page_facts(answer_of())["removals"]}
    assert notes["gravity"] == ""
    assert notes["affine field (PIC instead)"] == "dx/2 instead of dx changes more"
    assert notes["collider floor"] == ""
