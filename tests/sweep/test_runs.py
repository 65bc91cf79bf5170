
import pytest
from sweep_scenes import FLIGHT, observed_run, scene_of

from mpm_ref.executor import open_executor
from mpm_ref.scene import SceneError
from mpm_ref.sweep import observation
from mpm_ref.sweep import runs as runs_module
from mpm_ref.sweep.observation import CRASHED, FINISHED, REFUSED, STOPPED
from mpm_ref.sweep.runs import RunRequest, SceneRuns
from mpm_ref.sweep.setting import scene_at, setting
from mpm_ref.sweep.store import RunStore

SCENE = scene_of(FLIGHT)


@pytest.fixture
def runs():
    with open_executor(workers=1) as executor:
        yield SceneRuns(observed_run(SCENE), executor, RunStore())


def request_at(**knobs):
    return RunRequest(scene_at(SCENE, setting(**knobs)))


def test_each_run_is_made_once(runs):
    first = runs.observe({"a": request_at(), "b": request_at(dx=2.0)})
    again = runs.observe({"b": request_at(dx=2.0), "c": request_at(cfl=0.9)})
    assert list(again) == ["b", "c"]
    assert again["b"] is first["b"]
    assert runs.count == 3
    assert {one.outcome for one in again.values()} == {FINISHED}


def test_a_run_that_is_stored_is_known_before_it_is_asked_for(runs):
    assert not runs.has(request_at())
    runs.observe({"a": request_at()})
    assert runs.has(request_at())
    assert not runs.has(request_at(dx=2.0))
    assert runs.has(RunRequest(SceneError("none")))


def test_equal_scenes_are_run_once(runs):
    both = runs.observe({"a": request_at(particles=0.5), "b": request_at(particles=2 / 3)})
    assert runs.count == 1
    assert both["a"] is both["b"]


def test_a_scene_that_is_none_is_refused(runs):
    done = runs.observe({"a": RunRequest(SceneError("dx = -1: expected a length"))})["a"]
    assert (done.outcome, done.message) == (REFUSED, "dx = -1: expected a length")
    assert runs.count == 0


@pytest.mark.parametrize("fault", [MemoryError(), OSError("no such file")])
def test_what_may_pass_is_not_stored(runs, monkeypatch, fault):
    def fail(scene):
        raise fault
    with monkeypatch.context() as patch:
        patch.setattr(observation, "build", fail)
        done = runs.observe({"a": request_at()})["a"]
    assert done.outcome == CRASHED
    assert done.message in ("no such file", "no memory for it")
    assert runs.observe({"a": request_at()})["a"].outcome == FINISHED


def test_no_memory_within_a_run_is_not_stored(runs, monkeypatch):
    def fail(problem, on_step):
        raise MemoryError
        yield
    with monkeypatch.context() as patch:
        patch.setattr(observation, "simulate", fail)
        assert runs.observe({"a": request_at()})["a"].outcome == CRASHED
    assert runs.observe({"a": request_at()})["a"].outcome == FINISHED


def test_after_the_budget_no_run_begins():
    with open_executor(workers=1) as executor:
        runs = SceneRuns(observed_run(SCENE), executor, RunStore(), budget=0.0)
        done = runs.observe({"a": request_at()})["a"]
    assert done.outcome == STOPPED
    assert "not begun" in done.message


def test_each_run_is_reported(runs):
    reports = []
    runs.on_run = lambda label, observation: reports.append((label, observation.outcome))
    runs.observe({"a": request_at(dx=2.0)})
    assert reports == [("a", FINISHED)]


def fail(task):
    raise RuntimeError("broken")


def test_a_failure_is_an_outcome(runs, monkeypatch):
    monkeypatch.setattr(runs_module, "observe_in_time", fail)
    done = runs.observe({"a": request_at()})["a"]
    assert done.outcome == CRASHED
    assert "broken" in done.message


def test_processes_give_the_bits_of_one_process(runs):
    with open_executor(workers=2) as executor:
        others = SceneRuns(observed_run(SCENE), executor, RunStore())
        requests = {"a": request_at(), "b": request_at(dx=2.0)}
        here, there = runs.observe(requests), others.observe(requests)
    for label in requests:
        assert (here[label].values["positions"] == there[label].values["positions"]).all()
