import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from small_runs import colliding

from mpm_ref.monitor import Unstable, check
from mpm_ref.problem import Clock
from mpm_ref.simulate import simulate
from mpm_ref.store import checkpoint, writer
from mpm_ref.store.checkpoint import digest
from mpm_ref.store.results import BadResults, Results
from mpm_ref.store.running import Options, Refused, Watch, checkpoint_of, run
from mpm_ref.timestep import TooLarge

TESTS = Path(__file__).resolve().parents[1]
FIXED = Clock(dt=5e-4, steps=100, every=20)
ADAPTIVE = Clock(end=0.1, interval=0.013)
RESUME = Options(resume=True)


def straight(clock):
    """The state at the end of a run without files."""
    frames = list(simulate(colliding(clock)))
    return digest(frames[-1].state), len(frames)


@pytest.fixture(scope="module")
def ends():
    return {clock: straight(clock) for clock in (FIXED, ADAPTIVE)}


def assert_same_results(a, b):
    with Results(a) as a, Results(b) as b:
        for name in ("time", "dt", "step", "energy"):
            np.testing.assert_array_equal(getattr(a, name), getattr(b, name))
        for body in a.bodies:
            for name in a.fields(body):
                np.testing.assert_array_equal(a.field(body, name), b.field(body, name))


@pytest.mark.parametrize("clock", [FIXED, ADAPTIVE], ids=["fixed dt", "adaptive dt"])
def test_a_run_in_two_halves_is_the_run(tmp_path, ends, clock):
    whole = run(colliding(clock), tmp_path / "whole.h5")
    assert (digest(whole.state), whole.frames) == ends[clock]
    half = run(colliding(clock), tmp_path / "halves.h5", Options(steps=whole.state.step // 2))
    assert (half.why, half.state.step) == ("step limit", whole.state.step // 2)
    rest = run(colliding(clock), tmp_path / "halves.h5", RESUME)
    assert (rest.why, rest.same_code) == ("finished", True)
    assert digest(rest.state) == ends[clock][0]
    assert_same_results(tmp_path / "whole.h5", tmp_path / "halves.h5")


@settings(max_examples=8)
@given(cuts=st.lists(st.integers(1, 99), max_size=4).map(sorted),
       clock=st.sampled_from([FIXED, ADAPTIVE]))
def test_a_run_in_any_pieces_is_the_run(tmp_path_factory, ends, cuts, clock):
    out = tmp_path_factory.mktemp("pieces") / "run.h5"
    for steps in (*cuts, None):
        last = run(colliding(clock), out, Options(steps=steps, resume=True))
    assert (digest(last.state), last.frames) == ends[clock]


def test_checkpoints_do_not_change_a_run(tmp_path, ends):
    out = run(colliding(FIXED), tmp_path / "run.h5", Options(checkpoint_every=7))
    assert digest(out.state) == ends[FIXED][0]


def test_a_stopped_run_shows_its_last_state_until_it_goes_on(tmp_path):
    out = tmp_path / "run.h5"
    run(colliding(FIXED), out, Options(steps=50))
    with Results(out) as results:
        assert results.step.tolist() == [0, 20, 40, 50]
    run(colliding(FIXED), out, RESUME)
    with Results(out) as results:
        assert results.step.tolist() == [0, 20, 40, 60, 80, 100]
        parts = results.manifest["parts"]
    assert [(p["first_step"], p["last_step"], p["why"]) for p in parts] == [
        (0, 50, "step limit"), (50, 100, "finished")]


def test_a_finished_run_does_not_go_on(tmp_path, ends):
    out = tmp_path / "run.h5"
    run(colliding(FIXED), out)
    before = out.read_bytes()
    again = run(colliding(FIXED), out, RESUME)
    assert (again.why, digest(again.state)) == ("finished", ends[FIXED][0])
    assert out.read_bytes() == before
    assert run(colliding(FIXED), out, Options(steps=60, resume=True)).state.step == 100


class Signals(Watch):
    """Sends this process a signal in the middle of a run."""

    def __init__(self, number, step):
        self.number, self.at = number, step

    def step(self, state, dt):
        if state.step == self.at:
            os.kill(os.getpid(), self.number)


@pytest.mark.parametrize("step", [33, 40, 100], ids=["between frames", "at a frame", "at the end"])
@pytest.mark.parametrize(("number", "why"), [(signal.SIGINT, "interrupted"),
                                             (signal.SIGTERM, "terminated")])
def test_a_signal_ends_a_run_after_the_step(tmp_path, ends, step, number, why):
    out = tmp_path / "run.h5"
    before = signal.getsignal(number)
    first = run(colliding(FIXED), out, watch=Signals(number, step))
    assert signal.getsignal(number) is before
    assert (first.why, first.state.step) == ("finished" if step == 100 else why, step)
    last = run(colliding(FIXED), out, RESUME)
    assert (digest(last.state), last.frames) == ends[FIXED]


def test_a_second_signal_interrupts_at_once(tmp_path):
    class Twice(Signals):
        def step(self, state, dt):
            super().step(state, dt)
            super().step(state, dt)

    with pytest.raises(KeyboardInterrupt):
        run(colliding(FIXED), tmp_path / "run.h5", watch=Twice(signal.SIGINT, 33))


# A run that is killed without warning, at random times, until it gets to the end.
RUN = """
import sys
from small_runs import colliding
from mpm_ref.problem import Clock
from mpm_ref.store.running import Options, run
run(colliding(Clock(dt=5e-4, steps=400, every=5)), sys.argv[1],
    Options(resume=True, checkpoint_every=3))
"""


def started(out):
    here = os.pathsep.join([str(TESTS / "support"), str(TESTS.parent)])
    return subprocess.Popen([sys.executable, "-c", RUN, out],
                            env={**os.environ, "PYTHONPATH": here})


def steps_saved(out):
    path = checkpoint_of(out)
    return checkpoint.summary(path)["step"] if path.exists() else -1


def kill_later(process, out, seconds):
    """Kill the run some time after it has come further than its last checkpoint."""
    before = steps_saved(out)
    while process.poll() is None and steps_saved(out) <= before:
        time.sleep(0.01)
    time.sleep(seconds)
    process.kill()
    return process.wait()


def test_a_killed_run_goes_on_bit_for_bit(tmp_path, rng):
    clock = Clock(dt=5e-4, steps=400, every=5)
    out = tmp_path / "run.h5"
    killed = [kill_later(started(out), out, s) for s in rng.uniform(0.0, 0.3, 3)]
    assert -signal.SIGKILL in killed
    assert started(out).wait() == 0
    run(colliding(clock), tmp_path / "whole.h5")
    assert_same_results(tmp_path / "whole.h5", out)
    final = checkpoint.load(checkpoint_of(out), colliding(clock))[0]
    assert digest(final) == straight(clock)[0]


# What stands when a run breaks.

def unstable(clock=None):
    """Two stiff blocks, and a time step four times their bound."""
    problem = colliding(clock or Clock(dt=2e-2, steps=400, every=7), allow_unstable=True)
    body = problem.bodies[0]
    stiff = body._replace(law=type(body.law)(*(1.2 * p for p in body.law)))
    return replace(problem, bodies=(stiff, problem.bodies[1]))


def test_an_unstable_run_leaves_a_good_checkpoint(tmp_path):
    out = tmp_path / "run.h5"
    with pytest.raises(Unstable) as fault:
        run(unstable(), out, Options(checkpoint_every=1))
    state, _ = checkpoint.load(checkpoint_of(out), unstable())
    assert 0 < state.step < fault.value.step
    check(unstable(), state, 2e-2)
    with Results(out) as results:
        assert results.manifest["parts"][0]["why"].startswith("Unstable: unstable at step")
        assert results.step[-1] == fault.value.step


@pytest.mark.parametrize(("name", "fault", "steps"), [
    ("v", Unstable, [0, 20, 21]), ("F", TooLarge, [0, 20]),
], ids=["after its first step", "before it"])
def test_a_resumed_run_that_breaks_at_once_is_told(tmp_path, name, fault, steps):
    out = tmp_path / "run.h5"
    run(colliding(FIXED), out, Options(steps=20))
    state, _ = checkpoint.load(checkpoint_of(out), colliding(FIXED))
    getattr(state.bodies[0].particles, name)[:] *= 20.0 if name == "F" else 200.0
    checkpoint.save(checkpoint_of(out), state, colliding(FIXED))
    with pytest.raises(fault):
        run(colliding(FIXED), out, RESUME)
    with Results(out) as results:
        assert results.step.tolist() == steps
        assert [part["last_step"] for part in results.manifest["parts"]] == [20, steps[-1]]


def test_a_step_past_its_bound_is_refused_before_anything_is_written(tmp_path):
    with pytest.raises(TooLarge, match="past the stable time step"):
        run(replace(unstable(), allow_unstable=False), tmp_path / "run.h5")
    assert not list(tmp_path.iterdir())


def test_results_are_not_overwritten_by_accident(tmp_path):
    out = tmp_path / "run.h5"
    run(colliding(FIXED), out, Options(steps=10))
    with pytest.raises(Refused, match="--resume to continue it, --overwrite to replace it"):
        run(colliding(FIXED), out)
    assert run(colliding(FIXED), out, Options(overwrite=True)).state.step == 100
    with Results(out) as results:
        assert results.step.tolist() == [0, 20, 40, 60, 80, 100]


def test_an_overwritten_run_leaves_no_checkpoint(tmp_path):
    class Dies(Watch):
        def begin(self, problem, state):
            raise ZeroDivisionError

    out = tmp_path / "run.h5"
    run(colliding(FIXED), out)
    with pytest.raises(ZeroDivisionError):
        run(colliding(FIXED), out, Options(overwrite=True), Dies())
    assert not checkpoint_of(out).exists()
    assert run(colliding(FIXED), out, RESUME).state.step == 100


def test_a_run_killed_while_it_overwrites_goes_on(tmp_path, monkeypatch):
    """As soon as the new results are there, the checkpoint of the old ones is not."""
    real = writer.JournaledFile.move

    def killed(file, path):
        real(file, path)
        raise ZeroDivisionError

    out = tmp_path / "run.h5"
    run(colliding(FIXED), out, Options(steps=50))
    monkeypatch.setattr(writer.JournaledFile, "move", killed)
    with pytest.raises(ZeroDivisionError):
        run(colliding(FIXED), out, Options(overwrite=True))
    monkeypatch.undo()
    assert run(colliding(FIXED), out, RESUME).state.step == 100


def test_a_run_that_cannot_begin_to_overwrite_leaves_the_old_one(tmp_path, monkeypatch):
    out = tmp_path / "run.h5"
    run(colliding(FIXED), out, Options(steps=50))
    before = {file: file.read_bytes() for file in tmp_path.iterdir()}
    monkeypatch.setattr(writer, "_lay_out", lambda *_: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        run(colliding(FIXED), out, Options(overwrite=True))
    assert {file: file.read_bytes() for file in tmp_path.iterdir()} == before


def test_files_of_different_runs_do_not_go_on(tmp_path):
    out = tmp_path / "run.h5"
    run(colliding(FIXED), out, Options(steps=10))
    with pytest.raises(checkpoint.BadCheckpoint, match="another scene"):
        run(colliding(FIXED, source="other"), out, RESUME)
    checkpoint_of(out).unlink()
    with pytest.raises(BadResults, match="another scene"):
        run(colliding(FIXED, source="other"), out, RESUME)
    assert run(colliding(FIXED), out, RESUME).state.step == 100      # from the start
    out.unlink()
    with pytest.raises(Refused, match="no results beside the checkpoint"):
        run(colliding(FIXED), out, RESUME)


@pytest.mark.parametrize("options", [{"steps": 0}, {"checkpoint_every": 0},
                                     {"resume": True, "overwrite": True}])
def test_options_are_checked(options):
    with pytest.raises(ValueError, match=r"expected|at most one"):
        Options(**options)
