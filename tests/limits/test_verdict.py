"""Verdicts by synthetic runs of known values: which reference decides, and when there is none."""

from dataclasses import replace

import numpy as np
import pytest

from mpm_ref.limits.cause import NO_CONVERGENCE, RESOLUTION, SETTING, VANISHING
from mpm_ref.limits.cell import cell_of
from mpm_ref.limits.verdict import (
    AS_GIVEN,
    AT_COARSE,
    AT_FINE,
    LOST,
    RIGHT,
    UNCHECKED,
    WRONG,
    CellJudge,
    NoReference,
)
from mpm_ref.scene import SceneError, loads
from mpm_ref.sweep.observation import (
    FINISHED,
    REFUSED,
    STOPPED,
    TORN,
    UNSTABLE,
    RunCost,
    RunObservation,
)

SCENE = """
dim = 2
dx = 0.1
end = 1.0
gravity = [0.0, -1.0]
[[body]]
name = "block"
density = 1.0
shape = { type = "box", lower = [0.0, 0.0], upper = [1.0, 1.0] }
material = { law = "fixed_corotated", E = 1.0, nu = 0.3 }
"""
PROBES = (("block", np.array([[0.0, 0.0], [1.0, 1.0]])),)
BASE = {"as given": 1.10, "as given, 2 dx": 1.25, "as given, dx/2": 1.0}


def observation(displacement=1.0, outcome=FINISHED, cpu=1.0, start=0.0):
    """A run whose two numbers grow from `start` by a displacement; not finished: NaN."""
    values = start + np.array([[0.0, 0.0], [displacement, displacement]])
    if outcome != FINISHED:
        values[1:] = np.nan
    return RunObservation({"positions": values}, RunCost(cpu, cpu, 10, 4, 1), outcome,
                          "" if outcome == FINISHED else f"it was {outcome}")


class SyntheticRuns:
    """Observations by the label of a request; notes the labels and the requests."""

    def __init__(self, observations):
        self.observations, self.requests = observations, {}

    def observe(self, requests):
        self.requests |= requests
        return {label: self.answer(label, request) for label, request in requests.items()}

    def answer(self, label, request):
        if isinstance(request.scene, SceneError):
            return observation(outcome=REFUSED)
        answer = self.observations[label]
        return answer if isinstance(answer, RunObservation) else observation(answer)


def judge_of(error=0.01, **cells):
    runs = SyntheticRuns(BASE | cells)
    judge = CellJudge(loads(SCENE), runs, PROBES, ("positions",), error)
    judge.start()
    return judge


def verdict_on(factors, error=0.01, **runs):
    judge = judge_of(error, **runs)
    cell = cell_of(factors)
    return judge.judge([cell])[cell], judge


def labels(text, own, coarse=None, fine=None):
    """Observations of a cell and its companions by their labels."""
    answers = {text: own, f"{text}, 2 dx": coarse, f"{text}, dx/2": fine}
    return {label: answer for label, answer in answers.items() if answer is not None}


def test_tolerance_is_twice_the_scenes_own_difference_or_the_error():
    assert judge_of().tolerance["positions"] == pytest.approx(0.2)
    assert judge_of(error=0.5).tolerance["positions"] == 0.5


def test_a_fine_grid_decides_where_it_is_asked_for():
    judge = judge_of(**labels("density x 2", 3.0, 3.5, 9.0))
    cell = cell_of({"density": 2.0})
    assert judge.judge([cell])[cell].outcome == RIGHT
    assert judge.judge([cell], by_fine_grids=True)[cell].outcome == WRONG
    assert judge.verdicts[cell].reference == AT_FINE
    assert judge.judge([cell])[cell].outcome == WRONG


def test_a_quantity_that_is_no_number_is_no_reference():
    values = np.array([[np.nan, np.nan], [1.0, 1.0]])
    empty = RunObservation({"positions": values}, RunCost(1.0, 1.0, 10, 4, 1), FINISHED)
    with pytest.raises(NoReference, match="positions is not a number at some time"):
        judge_of(**{"as given": empty})


def test_agreement_with_the_coarse_grid_suffices():
    verdict, judge = verdict_on({"density": 2.0}, **labels("density x 2", 3.0, 3.5))
    assert (verdict.outcome, verdict.reference) == (RIGHT, AT_COARSE)
    assert verdict.error == pytest.approx(0.5 / 3.5)
    assert "density x 2, dx/2" not in judge.runs.requests


@pytest.mark.parametrize(("fine", "outcome"), [(2.6, RIGHT), (2.4, WRONG)])
def test_otherwise_the_fine_grid_decides(fine, outcome):
    verdict, _ = verdict_on({"density": 2.0}, **labels("density x 2", 3.0, 9.0, fine))
    assert (verdict.outcome, verdict.reference) == (outcome, AT_FINE)
    assert verdict.error == pytest.approx((3.0 - fine) / fine)
    assert verdict.quantity == "positions"


def test_coarse_run_that_fails_leaves_it_to_the_fine_one():
    verdict, _ = verdict_on({"density": 2.0}, **labels(
        "density x 2", 3.0, observation(outcome=UNSTABLE), 2.9))
    assert (verdict.outcome, verdict.reference) == (RIGHT, AT_FINE)


@pytest.mark.parametrize(("own", "outcome"), [(1.15, RIGHT), (1.25, WRONG)])
def test_numerical_axes_are_compared_with_the_scene_as_given(own, outcome):
    verdict, judge = verdict_on({"time_step": 0.5}, **{"time_step x 0.5": own})
    assert (verdict.outcome, verdict.reference) == (outcome, AS_GIVEN)
    assert len(judge.runs.requests) == 3


def test_mixed_cell_is_compared_with_its_physical_problem():
    verdict, judge = verdict_on({"time_step": 0.5, "density": 2.0}, **{
        "time_step x 0.5, density x 2": 3.0, "density x 2, dx/2": 2.9})
    assert (verdict.outcome, verdict.reference) == (RIGHT, AT_FINE)
    reference = judge.runs.requests["density x 2, dx/2"].scene
    assert (reference.dx, reference.body[0].density, reference.cfl) == (0.05, 2.0, None)


def test_shifted_scene_is_compared_by_its_changes():
    shifted = {"origin x 100": observation(1.1, start=99.0)}
    verdict, judge = verdict_on({"origin": 100.0}, **shifted)
    assert verdict.outcome == RIGHT
    assert judge.runs.requests["origin x 100"].probes[0][1] == pytest.approx(PROBES[0][1] + 99.0)
    stuck = {"origin x 100": observation(0.0, start=99.0)}
    assert verdict_on({"origin": 100.0}, **stuck)[0].outcome == WRONG


@pytest.mark.parametrize("outcome", [UNSTABLE, REFUSED])
def test_run_that_does_not_finish_has_its_outcome(outcome):
    verdict, _ = verdict_on({"density": 2.0}, **{"density x 2": observation(outcome=outcome)})
    assert (verdict.outcome, verdict.message) == (outcome, f"it was {outcome}")


def test_impossible_scene_is_refused():
    verdict, _ = verdict_on({"time_step": 10.0})        # cfl 5
    assert verdict.outcome == REFUSED


def test_long_run_is_told_from_one_that_the_budget_ended():
    for cpu, outcome in ((20.0, STOPPED), (3.0, None)):
        run = observation(outcome=STOPPED, cpu=cpu)
        verdict, judge = verdict_on({"density": 2.0}, **{"density x 2": run})
        assert judge.runs.requests["density x 2"].most_cpu == 20.0
        assert (verdict and verdict.outcome) == outcome


def test_cell_without_reference_is_not_checked():
    for cpu, outcome in ((20.0, UNCHECKED), (3.0, None)):
        runs = labels("density x 2", 3.0, 9.0, observation(outcome=STOPPED, cpu=cpu))
        verdict, _ = verdict_on({"density": 2.0}, **runs)
        assert (verdict and verdict.outcome) == outcome


@pytest.mark.parametrize(("coarse", "limit"), [(9.0, RESOLUTION), (2.5, NO_CONVERGENCE),
                                               (np.nan, RESOLUTION)])
def test_wrong_cell_has_the_name_of_its_limit(coarse, limit):
    verdict, judge = verdict_on({"density": 2.0}, **labels("density x 2", 3.0, coarse, 2.0))
    if coarse == 2.5:                   # it agrees with the cell, so that a fine grid is asked for
        verdict = judge.judge([cell_of({"density": 2.0})], True)[cell_of({"density": 2.0})]
    assert (verdict.outcome, verdict.limit) == (WRONG, limit)
    expected = np.inf if np.isnan(coarse) else abs(coarse - 2.0) / 2.0
    assert verdict.coarse_error == pytest.approx(expected)


def test_numerical_axes_meet_the_limit_of_a_setting():
    verdict, _ = verdict_on({"time_step": 0.5}, **{"time_step x 0.5": 1.25})
    assert (verdict.outcome, verdict.limit) == (WRONG, SETTING)
    assert verdict_on({"time_step": 0.5}, **{"time_step x 0.5": 1.15})[0].limit == ""


@pytest.mark.parametrize(("own", "limit"), [(3.0, SETTING), (4.5, RESOLUTION)])
def test_mixed_cell_meets_the_limit_of_a_setting_where_its_physical_problem_is_right(own, limit):
    judge = judge_of(**labels("density x 2", own, 6.0, 3.0),
                     **{"time_step x 0.5, density x 2": 4.0})
    physical, mixed = cell_of({"density": 2.0}), cell_of({"time_step": 0.5, "density": 2.0})
    judge.judge([physical])
    verdict = judge.judge([mixed])[mixed]
    assert (verdict.outcome, verdict.limit) == (WRONG, limit)


def test_warnings_and_indicators_of_the_run_belong_to_the_verdict():
    own = replace(observation(3.0), warnings=("dispersion: wide",), indicators={"dispersion": 3.0})
    verdict, _ = verdict_on({"density": 2.0}, **labels("density x 2", own, 3.5))
    assert verdict.outcome == RIGHT
    assert verdict.warnings == ("dispersion: wide",)
    assert verdict.indicators == {"dispersion": 3.0}


TORN_RUN = replace(observation(3.0), warnings=("gap: wide",))


@pytest.mark.parametrize(("own", "coarse", "fine", "message"), [
    (TORN_RUN, 3.0, 3.0, "gap: wide"), (3.0, 9.0, TORN_RUN, "at dx/2: gap: wide"),
    (3.0, TORN_RUN, TORN_RUN, "at dx/2: gap: wide")])
def test_a_cell_whose_run_or_reference_tears_is_torn(own, coarse, fine, message):
    verdict, _ = verdict_on({"density": 2.0}, **labels("density x 2", own, coarse, fine))
    assert (verdict.outcome, verdict.message, verdict.is_right) == (TORN, message, False)


def test_a_torn_coarse_run_does_not_make_a_cell_right():
    verdict, _ = verdict_on({"density": 2.0}, **labels("density x 2", 3.0, TORN_RUN, 3.1))
    assert (verdict.outcome, verdict.reference) == (RIGHT, AT_FINE)


def test_nothing_is_torn_where_the_scene_as_given_tears():
    base = {label: replace(observation(x), warnings=("gap: wide",)) for label, x in BASE.items()}
    verdict, _ = verdict_on({"density": 2.0}, **base, **labels("density x 2", TORN_RUN, 3.0))
    assert verdict.outcome == RIGHT


@pytest.mark.parametrize(("factors", "outcome"), [({"size": 2.0}, LOST), ({"density": 2.0}, LOST),
                                                  ({"time_step": 0.5}, RIGHT)])
def test_scene_without_a_contact_is_another_scene(factors, outcome):
    text = ", ".join(f"{name} x {factor:g}" for name, factor in factors.items())
    base = {label: replace(observation(x), contacts=("body 'block' with the floor",))
            for label, x in BASE.items()}
    verdict, judge = verdict_on(factors, **base, **{text: 1.1, f"{text}, 2 dx": 1.1})
    assert verdict.outcome == outcome
    if outcome == LOST:
        assert verdict.message == ("no contact of body 'block' with the floor, which the scene as "
                                   "given has")
        assert f"{text}, 2 dx" not in judge.runs.requests


def test_missing_values_are_no_agreement():
    verdict, _ = verdict_on({"density": 2.0}, **labels(
        "density x 2", 3.0, observation(np.nan), observation(np.nan)))
    assert verdict.outcome == WRONG


def test_quantity_at_the_end_is_compared_there_alone():
    values = {"as given": [0.0, 5.0, 1.1], "as given, dx/2": [0.0, 1.0, 1.0]}
    runs = SyntheticRuns({label: replace(observation(), values={
        text: np.array([values.get(label, values["as given"])]).T
        for text in ("positions", "positions@end")}) for label in BASE})
    judge = CellJudge(loads(SCENE), runs, PROBES, ("positions", "positions@end"), 0.01)
    judge.start()
    assert judge.tolerance == {"positions": pytest.approx(8.0),
                               "positions@end": pytest.approx(0.2)}


@pytest.mark.parametrize(("own", "fine", "limit"), [
    (0.02, 0.001, VANISHING),       # 20 times its change, 2 % of that in the scene as given
    (0.5, 0.001, RESOLUTION),       # half the change in the scene as given is no little
    (0.002, 0.0015, RESOLUTION),    # small, and a third off
    (0.04, 0.015, RESOLUTION)])     # 1.5 % of the change is left
def test_a_quantity_that_nearly_vanishes_is_wrong_by_name(own, fine, limit):
    verdict, _ = verdict_on({"density": 2.0}, **labels("density x 2", own, 9.0, fine))
    assert (verdict.outcome, verdict.limit) == (WRONG, limit)
    assert verdict.error == pytest.approx((own - fine) / fine)
    assert verdict.share == pytest.approx(fine)


def test_an_ordinary_wrong_quantity_stands_before_one_that_vanishes():
    def run(kinetic, elastic):
        return replace(observation(), values={"kinetic": np.array([[0.0], [kinetic]]),
                                              "elastic": np.array([[0.0], [elastic]])})
    base = {"as given": run(1.1, 1.1), "as given, dx/2": run(1.0, 1.0)}
    for elastic, expected in ((1.5, ("elastic", RESOLUTION)), (1.1, ("kinetic", VANISHING))):
        runs = SyntheticRuns(base | labels("density x 2", run(0.02, elastic), run(9.0, 9.0),
                                           run(0.001, 1.0)))
        judge = CellJudge(loads(SCENE), runs, PROBES, ("kinetic", "elastic"), 0.01)
        judge.start()
        verdict = judge.judge([cell_of({"density": 2.0})])[cell_of({"density": 2.0})]
        assert (verdict.quantity, verdict.limit) == expected


@pytest.mark.parametrize(("own", "outcome"), [(0.1, RIGHT), (0.3, WRONG)])
def test_what_is_zero_is_compared_with_the_change_in_the_scene_as_given(own, outcome):
    """The tolerance is 20 % of a displacement of 50 m."""
    base = {label: 50.0 * x for label, x in BASE.items()}
    verdict, _ = verdict_on({"density": 2.0}, **base, **labels(
        "density x 2", 50.0 * own, 400.0, 0.0))
    assert (verdict.outcome, verdict.error) == (outcome, pytest.approx(own))


def test_cheapest_cells_have_their_fine_runs_first():
    runs = {label: value for factor, cpu in ((2.0, 5.0), (3.0, 1.0)) for label, value in labels(
        f"density x {factor:g}", observation(3.0, cpu=cpu), 9.0, 3.0).items()}
    judge = judge_of(**runs)
    judge.judge([cell_of({"density": factor}) for factor in (2.0, 3.0)])
    fine = [label for label in judge.runs.requests if label.startswith("density")
            and label.endswith("dx/2")]
    assert fine == ["density x 3, dx/2", "density x 2, dx/2"]


def test_a_difference_from_the_coarse_grid_is_kept_where_the_budget_ends():
    cell = cell_of({"density": 2.0})
    late = observation(outcome=STOPPED, cpu=0.0)
    judge = judge_of(**labels("density x 2", 3.0, 4.5, late))
    assert judge.judge([cell])[cell] is None
    assert judge.coarse[cell].error == pytest.approx(1.0 / 3.0)
    assert judge.coarse[cell].reference == AT_COARSE


def test_a_pair_is_refused_by_one_axis_alone_for_the_same_cause():
    judge = judge_of()
    judge.runs.requests.clear()
    known = judge.refused_alone(cell_of({"time_step": 10.0, "density": 2.0}))
    assert (known.outcome, known.alone) == (REFUSED, "time_step")
    assert "cfl = 5.0" in known.message
    assert judge.refused_alone(cell_of({"time_step": 10.0})) is None
    assert judge.refused_alone(cell_of({"stiffness": 10.0, "density": 2.0})) is None
    assert not judge.runs.requests
    assert list(judge.verdicts) == [()]


def test_no_run_is_asked_for_twice():
    judge = judge_of(**labels("density x 2", 3.0, 3.0))
    cell = cell_of({"density": 2.0})
    judge.judge([cell])
    judge.runs.requests.clear()
    assert judge.judge([cell, cell])[cell].outcome == RIGHT
    assert judge.judge([()])[()].outcome == RIGHT
    assert not judge.runs.requests


@pytest.mark.parametrize(("label", "outcome", "message"), [
    ("as given", UNSTABLE, "as given: unstable: it was unstable"),
    ("as given, dx/2", STOPPED, "it may take 8 s of CPU time"),
])
def test_scene_without_reference_is_said_so(label, outcome, message):
    with pytest.raises(NoReference, match=message):
        judge_of(**{label: observation(outcome=outcome)})
