"""`mpm-ref rom generate --scheduler`: runs by the workers of a dask cluster."""

import threading

import numpy as np
import pytest
from command_line import assert_told, mpm_ref
from small_studies import STEPS, ended, generated, study, write

from mpm_ref.executor import SchedulerLost, stop_asked
from mpm_ref.executor.tasks import set_stop_source
from mpm_ref.rom.study import distribute
from mpm_ref.rom.study.generate import STOP_WATCH, file_of, generate_run
from mpm_ref.store.results import Results

pytest.importorskip("distributed")
LOCAL = ("--scheduler", "local:2")


def positions(file):
    with Results(file) as results:
        return results.field("bar", "x")[:]


def test_runs_are_those_of_this_process_to_the_last_bit(tmp_path):
    _, data = generated(tmp_path, "here")
    done = mpm_ref("rom", "generate", tmp_path / "bars.toml", "--out", tmp_path / "there", *LOCAL)
    assert done.exit_code == 0, done.output
    first, *lines, last = done.stdout.splitlines()
    assert first.endswith("4 runs of bars, on workers of local:2")
    assert len(lines) == 4
    assert "made 4, continued 0, 0 were there" in last
    for k in range(4):
        np.testing.assert_array_equal(positions(file_of(data, k)),
                                      positions(file_of(tmp_path / "there", k)))
    again = mpm_ref("rom", "generate", tmp_path / "bars.toml", "--out", tmp_path / "there", *LOCAL)
    assert "made 0, continued 0, 4 were there" in again.stdout


def test_unstable_run_has_status_3(tmp_path):
    bars = write(tmp_path, ("to = 4.0\ncount = 4", "to = 1e6\ncount = 3"))
    done = mpm_ref("rom", "generate", bars, "--out", tmp_path / "data", *LOCAL)
    assert_told(done, 3, "(g = ", "unstable")


@pytest.mark.parametrize(("options", "words"), [
    (("--scheduler", "nowhere"), ("scheduler 'nowhere': expected local:N", "tcp://host:8786")),
    (("--workers", 2, *LOCAL), ("--workers 2 and --scheduler local:2: give one of the two",)),
])
def test_bad_options_are_refused(tmp_path, options, words):
    done = mpm_ref("rom", "generate", write(tmp_path), "--out", tmp_path / "data", *options)
    assert_told(done, 2, *words)


def test_lost_scheduler_ends_the_command_with_a_sentence(tmp_path, monkeypatch):
    def lose(*_):
        raise SchedulerLost("the dask scheduler has gone: the same command goes on")
        yield

    monkeypatch.setattr("mpm_ref.cli.rom_train.generate_on", lose)
    done = mpm_ref("rom", "generate", write(tmp_path), "--out", tmp_path / "data", *LOCAL)
    assert_told(done, 4, "the same command goes on")


@pytest.fixture
def stop():
    """Runs ask for a stop when the event is set, as in a worker."""
    event, before = threading.Event(), STOP_WATCH.stop
    set_stop_source(event.is_set)
    distribute.watch_executor()
    yield event
    set_stop_source(None)
    STOP_WATCH.stop = before


def test_stopped_run_in_a_thread_ends_at_once_and_resumes(tmp_path, stop, monkeypatch):
    bars, ends, dt = study(tmp_path), [], []

    def step(state, length):
        dt.append(length)
        if len(dt) == STEPS - 1:
            stop.set()
        return original(state, length)

    def perform():
        try:
            ends.append(generate_run(bars, tmp_path, 0))
        except KeyboardInterrupt:
            ends.append("interrupted")

    original = STOP_WATCH.step
    monkeypatch.setattr(STOP_WATCH, "step", step)
    thread = threading.Thread(target=perform)
    thread.start()
    thread.join()
    assert ends == ["interrupted"]
    assert stop_asked()
    stop.clear()
    done = generate_run(bars, tmp_path, 0)
    assert (done.why, done.continued) == ("finished", True)
    assert ended(file_of(tmp_path, 0)) == ("finished", STEPS + 1)


def test_failed_task_ends_the_loop(tmp_path, monkeypatch):
    monkeypatch.setattr(distribute, "generate_run", broken_run)
    done, = distribute.generate_on("local:1", study(tmp_path), tmp_path)
    assert done.message == "run 0: ArithmeticError: no ground"
    assert not done.has_data


def broken_run(study, folder, k):
    raise ArithmeticError("no ground")
