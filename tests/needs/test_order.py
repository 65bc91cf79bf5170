"""Verdicts and the order of removals, on runs whose change and cost are given by formulas."""

from dataclasses import dataclass, field
from math import inf

import numpy as np
import pytest

from mpm_ref.needs.ingredients import Removal
from mpm_ref.needs.removal import (
    AS_GIVEN,
    COSTLY,
    IMPOSSIBLE,
    MOST_CPU,
    NOT_REQUIRED,
    REQUIRED,
    UNMEASURED,
    RemovalStudy,
    saving,
)
from mpm_ref.scene import SceneError
from mpm_ref.sweep.observation import (
    CRASHED,
    FINISHED,
    REFUSED,
    STOPPED,
    UNSTABLE,
    RunCost,
    RunObservation,
)

INSTEAD = " (other instead)"
CPU = 100.0         # [s] of the scene as given
ENDS = {"weak": UNSTABLE, "vital": REFUSED, "slow": STOPPED, "dark": CRASHED}


@dataclass(frozen=True)
class ToyScene:
    """A scene that is a set of names; `dim` is read for the cost of finer grids."""

    names: frozenset
    dim: int = 2


@dataclass(frozen=True)
class ToyVariant:
    """A variant without some names."""

    scene: ToyScene
    removals: tuple = ()
    probes: tuple = ()
    rows: tuple = ()
    halves: tuple = ()
    axes: tuple = (0, 1)
    length: float = 1.0

    def quantity(self, text):
        """The text of a quantity, the same in all variants."""
        return text

    def cuts_of(self, quantity):
        """No halves."""
        return []

    @property
    def offers(self):
        """One removal for each name, which ends with what stands instead, if anything does."""
        return {name: Removal(name.removesuffix(INSTEAD), None,
                              "other" if name.endswith(INSTEAD) else "", is_output=name == "frames")
                for name in sorted(self.scene.names)}

    def without(self, removal):
        """The variant after a removal."""
        if removal.label == "broken":
            raise SceneError("broken: no scene")
        if removal.label == "fewer than one":
            return self
        left = ToyScene(self.scene.names - {removal.label})
        return ToyVariant(left, (*self.removals, removal))


@dataclass
class ToyRuns:
    """Runs whose change is a sum of shares, and whose CPU time a product of factors."""

    change: dict
    factor: dict
    budget: int = 10**9
    left: float = inf
    labels: list = field(default_factory=list)
    quantities: tuple = ("kinetic",)

    def observe(self, requests):
        """{label: observation} of requests, whose names that are gone say all."""
        return {label: self.observation(label, request) for label, request in requests.items()}

    def observation(self, label, request):
        """The observation of one request."""
        if isinstance(request.scene, SceneError):
            return RunObservation({}, RunCost(), REFUSED, str(request.scene))
        self.labels.append(label)
        if len(self.labels) > self.budget:
            return RunObservation({}, RunCost(cpu=0.0), STOPPED, "not begun")
        gone = self.change.keys() - request.scene.names
        for name in gone & ENDS.keys():
            return RunObservation({}, RunCost(cpu=1.01 * MOST_CPU * CPU), ENDS[name], name)
        cpu = CPU * np.prod([self.factor.get(name, 1.0) for name in gone])
        total = sum(self.change[name] for name in gone)
        values = np.array([[0.0], [1.0 + total]])
        return RunObservation({"kinetic": values}, RunCost(cpu=float(cpu)), FINISHED)


def result_of(change, factor=None, error=0.01, budget=10**9):
    """(`NeedsResult`, runs) of a toy scene."""
    runs = ToyRuns(change, factor or {}, budget)
    study = RemovalStudy(runs, ToyVariant(ToyScene(frozenset(change))), error)
    study.on_grid = lambda factor: {}
    return study.result(), runs


def verdicts(result):
    """{label: verdict} of the removals one by one."""
    return {run.label: run.verdict for run in result.singles}


def test_verdicts():
    result, _ = result_of({"a": 0.5, "b": 0.009, "c": 0.001, "d": 0.001, "weak": 0.0, "vital": 0.0,
                           "dark": 0.0, "slow": 0.0, "broken": 0.0}, {"c": 0.5, "d": 1.5})
    assert verdicts(result) == {
        "a": REQUIRED, "b": NOT_REQUIRED, "c": NOT_REQUIRED, "d": COSTLY, "weak": REQUIRED,
        "vital": IMPOSSIBLE, "dark": IMPOSSIBLE, "slow": COSTLY, "broken": IMPOSSIBLE}
    runs = {run.label: run for run in result.singles}
    assert runs["a"].changes == pytest.approx({"kinetic": 0.5})
    assert saving(runs["c"], result.cpu) == pytest.approx(0.5)


def test_order_is_that_of_the_cpu_time():
    result, _ = result_of({"a": 0.002, "b": 0.002, "c": 0.002}, {"a": 0.9, "b": 0.5, "c": 0.7})
    assert [run.label for run in result.order] == ["b", "c", "a"]
    assert [run.cpu for run in result.order] == pytest.approx([50.0, 35.0, 31.5])
    assert [one.label for one in result.lean.removals] == ["b", "c", "a"]
    assert result.complete


def test_error_since_the_scene_as_given_bounds_the_order():
    result, _ = result_of({"a": 0.006, "b": 0.006, "c": 0.003}, {"a": 0.5, "b": 0.6, "c": 0.9})
    assert [run.label for run in result.order] == ["a", "c"]
    assert result.order[-1].change == pytest.approx(0.009)


def test_required_ones_are_not_tried_again():
    _, runs = result_of({"a": 0.5, "b": 0.002}, {"b": 0.9})
    assert runs.labels.count("a") == 1


def test_a_removal_that_leaves_the_scene_as_it_is_ends():
    """One point is offered to become fewer again and again."""
    result, _ = result_of({"fewer than one": 0.0, "a": 0.002}, budget=100)
    assert verdicts(result)["fewer than one"] == IMPOSSIBLE
    assert [run.label for run in result.order] == ["a"]
    assert result.complete


def test_removals_that_change_nothing_go_together():
    result, runs = result_of({"a": 0.0, "b": 0.0, "c": 1e-12, "d": 0.002}, {"d": 0.5})
    assert [run.label for run in result.order] == ["a and b and c", "d"]
    assert len(result.lean.removals) == 4
    assert runs.labels.count("a") == 1


def test_removals_that_change_something_together_go_one_by_one(monkeypatch):
    def together(self, label, request):
        gone = self.change.keys() - request.scene.names
        values = np.array([[0.0], [1.0 + (0.5 if len(gone) == 2 else 0.0)]])
        return RunObservation({"kinetic": values}, RunCost(cpu=CPU), FINISHED)

    monkeypatch.setattr(ToyRuns, "observation", together)
    result, _ = result_of({"a": 0.0, "b": 0.0})
    assert [run.label for run in result.order] == ["a"]


@pytest.mark.parametrize("change", [0.0, 0.002])
def test_what_is_replaced_must_save_time(change):
    label = f"swap{INSTEAD}"
    assert [run.label for run in result_of({label: change}, {label: 0.5})[0].order] == [label]
    result, _ = result_of({label: change}, {label: 0.99})
    assert verdicts(result) == {label: NOT_REQUIRED}
    assert result.order == ()


def test_lean_scene_keeps_the_output():
    result, _ = result_of({"frames": 0.0, "a": 0.002})
    assert verdicts(result)["frames"] == NOT_REQUIRED
    assert [run.label for run in result.order] == ["a"]


def test_budget_ends_the_order_and_says_what_is_missing():
    result, _ = result_of({"a": 0.5, "b": 0.002, "c": 0.002}, budget=4)
    assert verdicts(result) == {"a": REQUIRED, "b": NOT_REQUIRED, "c": UNMEASURED}
    assert not result.complete
    assert result.missing_cpu >= CPU


def test_order_that_the_budget_ends_is_not_complete():
    result, _ = result_of({"a": 0.5, "b": 0.002, "c": 0.002}, budget=5)
    assert verdicts(result) == {"a": REQUIRED, "b": NOT_REQUIRED, "c": NOT_REQUIRED}
    assert (result.order, result.complete) == ((), False)


def test_scene_that_does_not_run_has_no_result():
    runs = ToyRuns({"a": 0.0}, {}, budget=0)
    study = RemovalStudy(runs, ToyVariant(ToyScene(frozenset("a"))), 0.01)
    assert study.result() is None
    assert study.base.outcome == STOPPED


def test_cpu_time_is_the_least_of_equal_runs(monkeypatch):
    given, frames = iter((1.9, 1.5, 1.8, 1.7)), iter((3.0, 1.6, 1.7))

    def short(self, label, request):
        times = given if label == AS_GIVEN else frames
        return RunObservation({"kinetic": np.array([[0.0], [1.0]])}, RunCost(cpu=next(times)),
                              FINISHED)

    monkeypatch.setattr(ToyRuns, "observation", short)
    result, _ = result_of({"frames": 0.0})
    assert result.cpu == 1.5
    assert result.noise == pytest.approx(1.9 / 1.5 - 1.0)
    single, = result.singles
    assert (single.cpu, single.verdict) == (1.6, NOT_REQUIRED)
