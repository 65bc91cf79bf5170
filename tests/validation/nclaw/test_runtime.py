"""NCLaw's Table 3: which runs are timed, and what is recorded of their times."""

import numpy as np
import pytest
from record_verdicts import expected, verdict

from mpm_ref.nclaw.bodies import copy_body
from mpm_ref.nclaw.gnn.simulator import Simulator
from mpm_ref.scene import build
from tests.validation.nclaw.test_gnn_evaluate import still, water
from validation.common import targets
from validation.common.results import ProfileResults
from validation.common.run import RunSetting, run_all
from validation.common.weights_needed import Untrained
from validation.nclaw import runtime
from validation.nclaw.environments import environment
from validation.nclaw.initial_laws import untrained
from validation.nclaw.simulators import simulators

REPEATS = 10


@pytest.fixture
def runs(monkeypatch):
    """Weights of sand and its graph network are there. What was run, as (law, steps); a run of ours
    takes k seconds, k its number, of a graph network three times, of the true laws half of that, in
    single precision 0.1 k.
    """
    asked, block = [], build(environment("sand", steps=5)).bodies[0]

    def found(name):
        if not name.startswith("sand"):
            raise Untrained(f"no weights {name}.npz")
        return still() if name.endswith("gnn") else untrained()

    def took(scene, law):
        word = "true" if law is copy_body else "gnn" if isinstance(law, Simulator) else (
            "ours" if law(block).law.W.dtype == float else "single")
        asked.append((word, scene.steps))
        k = sum(one == (word, 1000) for one in asked)
        factor = {"true": 0.5, "ours": 1.0, "gnn": 3.0, "single": 0.1}[word]
        return k * factor, k * (0.2 if word == "single" else 10.0)

    monkeypatch.setattr(runtime, "trained", found)
    monkeypatch.setattr(runtime, "run_times", took)
    return asked


def recorded(folder):
    setting = RunSetting("standard", folder, targets=targets.load())
    assert run_all([runtime.table3.experiment], setting) == []
    return {r.target: r for r in ProfileResults(folder).records("nclaw.table3")}


def test_laws_and_graph_networks_are_timed_in_turn(tmp_path, runs):
    """Each first in a run that compiles, which is not counted."""
    recorded(tmp_path)
    words = ("ours", "gnn", "single", "true")
    assert runs == [*((word, 5) for word in words),
                    *((word, 1000) for _ in range(REPEATS) for word in words)]


def test_medians_stand_beside_the_printed_times(tmp_path, runs):
    found = recorded(tmp_path)
    ours, gnn = (found[f"nclaw.table3.{id}"] for id in ("ours.sand", "gnn.sand.narrow"))
    assert (ours.value, expected(ours), verdict(ours)) == (5.5, 2.55, "info")
    assert (gnn.value, expected(gnn), verdict(gnn)) == (16.5, 2.1, "info")
    assert f"of {REPEATS} runs" in ours.note
    assert gnn.note.endswith(simulators()["sand-gnn"].description)
    assert found["nclaw.table3.gnn.sand.cpu"].value == pytest.approx(55.0 / 1e6)
    assert found["nclaw.table3.gnn.sand.over_true"].value == 1.0


def test_times_in_single_precision_have_ids_and_a_bound_of_their_own(tmp_path, runs):
    found = recorded(tmp_path)
    wall, cpu, most = (found[f"nclaw.table3.single{id}"] for id in (".sand", ".sand.cpu", ".cpu"))
    assert (wall.value, verdict(wall)) == (pytest.approx(0.55), "info")
    assert (cpu.value, verdict(cpu)) == (pytest.approx(1.1e-6), "info")
    assert (most.value, most.bound, verdict(most)) == (pytest.approx(1.1e-6), 1.2e-6, "pass")


def test_a_broken_run_in_single_precision_misses_the_bound(tmp_path, runs, monkeypatch):
    """Whichever of the materials it is."""
    timed, steps = runtime.record, iter([1e-6, np.nan])
    monkeypatch.setattr(runtime, "trained", lambda name: untrained())
    monkeypatch.setattr(runtime, "methods", lambda name, models: (
        {"single": copy_body} if name in ("jelly", "sand") else {}))

    def broken(*arguments):
        timed(*arguments)
        return next(steps)

    monkeypatch.setattr(runtime, "record", broken)
    assert verdict(recorded(tmp_path)["nclaw.table3.single.cpu"]) == "miss"


def test_what_is_not_trained_is_told_and_not_run(tmp_path, runs):
    found = recorded(tmp_path)
    assert found["nclaw.table3.untrained"].value == 6
    assert not {target for target in found if target.endswith(("jello", "water"))}


@pytest.mark.parametrize("law", [copy_body, still()], ids=["laws", "graph network"])
def test_a_run_takes_time(law):
    wall, cpu = runtime.run_times(water(5), law)
    assert 0.0 < wall < 60.0
    assert 0.0 < cpu


def test_a_run_that_breaks_down_has_no_time():
    assert np.isnan(runtime.run_times(water(15), still(a=np.inf))).all()


def test_times_of_runs_that_break_down_are_not_recorded(tmp_path, runs, monkeypatch):
    timed = runtime.run_times
    monkeypatch.setattr(runtime, "run_times", lambda scene, law: (
        (np.nan, np.nan) if isinstance(law, Simulator) else timed(scene, law)))
    found = recorded(tmp_path)
    assert found["nclaw.table3.gnn.sand.narrow"].value is None
    assert runtime.LOST in found["nclaw.table3.gnn.sand.narrow"].note
    assert found["nclaw.table3.ours.sand"].value == 5.5
    assert runtime.LOST not in found["nclaw.table3.ours.sand"].note
