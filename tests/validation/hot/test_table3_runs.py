"""Steps that are measured over an entire run lie evenly, and are steps of the run itself."""

from types import SimpleNamespace

import numpy as np
import pytest

from mpm_ref.scene import build
from mpm_ref.simulate import simulate
from validation.common.scenes import catalogue_scene, with_
from validation.hot import table3_runs, whole_runs
from validation.hot.run_history import run_history
from validation.hot.run_states import RunStates, even_times
from validation.hot.table3_runs import steps_evenly


def small(steps):
    """The first steps of a bust of few particles, held at its foot and turned at its head."""
    scene = catalogue_scene("hot_faceless", unstable="allow", dx=0.06, integrator="hot")
    scene = with_(scene, end=steps * scene.longest)
    body = scene.body[0]
    return with_(scene, body=(with_(body, sampling=with_(body.sampling, count=500)),))


def measured(problem, folder):
    """Step number, time and length of three steps evenly over a problem's run, and its last x."""
    states, found = RunStates(folder, "bust", even_times(problem, 3)), []
    for state, step in steps_evenly(problem, states):
        found.append((state.step, step.t, step.dt))
    return found, [body.particles.x for body in state.bodies]


def test_steps_lie_evenly_over_a_run_and_do_not_change_it(tmp_path):
    found, last = measured(build(small(6)), tmp_path)
    dt = found[0][2]
    assert [n for n, _, _ in found] == [1, 3, 5]
    np.testing.assert_allclose([t for _, t, _ in found], [dt, 3 * dt, 5 * dt], rtol=1e-12)
    frames = list(simulate(build(small(5))))
    assert frames[-1].state.step == 5
    for ours, theirs in zip(last, frames[-1].state.bodies, strict=True):
        np.testing.assert_array_equal(np.sort(ours, axis=0), np.sort(theirs.particles.x, axis=0))


@pytest.mark.parametrize("missing", [(), (0,), (1,), (2,), (0, 1, 2)])
def test_steps_from_states_on_disk_are_those_of_the_run(tmp_path, missing, monkeypatch):
    """Also where a state is damaged: it is computed again, from the one before it."""
    problem = build(small(6))
    expected = measured(problem, tmp_path)
    states = RunStates(tmp_path, "bust", even_times(problem, 3))
    for k in missing:
        states.path(k).write_bytes(states.path(k).read_bytes()[:-40])
    if not missing:
        monkeypatch.setattr(table3_runs, "take_step", lambda *_: pytest.fail("it is on disk"))
    found, last = measured(build(small(6)), tmp_path)
    assert found == expected[0]
    for ours, theirs in zip(last, expected[1], strict=True):
        np.testing.assert_array_equal(ours, theirs)


def test_whole_run_leaves_the_states_that_steps_are_measured_from(tmp_path, monkeypatch):
    problem = build(small(20))
    run_history(small(20), tmp_path / "bust.npz", 1e3, with_states=True)
    states = RunStates(tmp_path, "bust", even_times(problem))
    monkeypatch.setattr(table3_runs, "take_step", lambda *_: pytest.fail("it is on disk"))
    stored = [(state.step, step.dt) for state, step in steps_evenly(problem, states)]
    monkeypatch.undo()
    anew = RunStates(tmp_path / "none", "bust", even_times(problem))
    assert stored == [(state.step, step.dt) for state, step in steps_evenly(problem, anew)]
    assert [n for n, _ in stored] == [*range(1, 20, 2)]


def test_states_of_another_scene_are_not_read(tmp_path):
    measured(build(small(6)), tmp_path)
    other = build(small(7))
    assert RunStates(tmp_path, "bust", even_times(other, 3)).read(0, other) is None


@pytest.mark.parametrize(("profile", "end"), [("quick", ".small"), ("standard", ".small"),
                                              ("paper", "")])
def test_numbers_of_the_printed_size_alone_are_the_printed_ones(profile, end, tmp_path):
    found = []
    values = [("faceless", short, 9, 1, 2.0, 30.0, 1.0, 0.1, True) for short in table3_runs.METHODS]
    rows = [("faceless", 0.0, 0.1, 9, short, 2, 30, True) for short in table3_runs.METHODS]
    run = SimpleNamespace(
        profile=profile, folder=tmp_path, choose=lambda **by: by[profile],
        progress=lambda names, _: ["faceless"], table=lambda *_: None,
        cached=lambda name, make: (dict(zip(table3_runs.METHODS, values, strict=True)), rows),
        record=lambda id, value, **rest: found.append((id, value)))
    table3_runs.table3_runs(run)
    assert found == [(f"hot.table3.faceless.{short}.cg_iters{end}", 30.0)
                     for short in table3_runs.METHODS]


@pytest.mark.parametrize(("profile", "name", "kept"), [
    ("quick", "faceless", False), ("standard", "wheel", True), ("paper", "faceless", True),
    ("paper", "wheel", False)])
def test_states_are_kept_of_runs_whose_steps_are_measured(profile, name, kept):
    assert whole_runs.is_measured(SimpleNamespace(profile=profile), name) is kept
