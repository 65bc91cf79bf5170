"""Tasks in this process and in local ones."""

import multiprocessing
import os
import signal
import subprocess
import sys
import textwrap
import time
from contextlib import contextmanager
from pathlib import Path

import pytest
from executor_scene import final_positions
from executor_tasks import (
    all_end,
    await_stop_but_first,
    catches_its_signal,
    die_at_first,
    exit_on_odd,
    fail_on_odd,
    failing_setup,
    gather,
    interrupt,
    note_setup,
    noted,
    noted_again,
    process_number,
    process_numbers,
    sleep_on,
    square,
    thread_numbers,
    value_that_cannot_be_read,
    value_that_cannot_travel,
)

from mpm_ref.executor import open_executor, processes, stop_asked, worker

ROOT = Path(__file__).resolve().parents[2]
SUPPORT = ROOT / "tests" / "support"


@pytest.fixture(scope="module")
def executors():
    """Executors of one and of two workers, by that number."""
    with open_executor(workers=1) as one, open_executor(workers=2) as two:
        yield {1: one, 2: two}


def outcomes(executor, function, tasks):
    """The outcomes by index; each task has one."""
    ended = list(executor.run(function, tasks))
    by_index = {outcome.index: outcome for outcome in ended}
    assert sorted(by_index) == list(range(len(tasks))) == sorted(o.index for o in ended)
    return by_index


@pytest.mark.parametrize("workers", [1, 2])
def test_values_of_all_tasks(executors, workers):
    ended = outcomes(executors[workers], square, range(20))
    assert [ended[k].value for k in range(20)] == [k * k for k in range(20)]
    assert all(outcome.error is None for outcome in ended.values())


@pytest.mark.slow
def test_eight_workers_perform_tasks_at_a_time(tmp_path):
    with open_executor(workers=8) as executor:
        ended = outcomes(executor, gather, [(str(tmp_path), 8)] * 16)
    assert len({outcome.value for outcome in ended.values()}) == 8


def test_no_task_needs_no_process():
    before = set(multiprocessing.active_children())
    with open_executor(workers=2) as executor:
        assert outcomes(executor, square, []) == {}
        assert set(multiprocessing.active_children()) == before


def test_one_worker_is_this_process_and_lazy():
    tasks = iter(range(3))
    with open_executor(workers=1) as executor:
        assert next(executor.run(process_number, tasks)).value == os.getpid()
    assert list(tasks) == [1, 2]
    assert (executor.workers, executor.dashboard) == (1, None)


def test_workers_are_several_processes_that_serve_again(tmp_path):
    with open_executor(workers=2) as executor:
        first, second = ({o.value for o in executor.run(gather, [(str(tmp_path), 2)] * 2)}
                         for _ in range(2))
    assert len(first) == 2
    assert second <= first
    assert os.getpid() not in first
    assert all_end(first)
    assert (executor.workers, executor.dashboard) == (2, None)


@pytest.mark.parametrize("workers", [1, 2])
def test_exceptions_are_outcomes(executors, workers):
    ended = outcomes(executors[workers], fail_on_odd, range(4))
    assert [ended[k].value for k in range(4)] == [0, None, 2, None]
    assert ended[3].error == "ValueError: 3 is odd"
    assert "in fail_on_odd" in ended[3].traceback
    assert ended[2].traceback is None


@pytest.mark.parametrize("workers", [1, 2])
def test_exit_ends_a_task_alone(executors, workers):
    ended = outcomes(executors[workers], exit_on_odd, range(4))
    assert ended[1].error == "SystemExit: 3"
    assert ended[2].value == 2


@pytest.mark.parametrize("workers", [1, 2])
def test_setup_runs_once_in_each_process(workers):
    with open_executor(workers=workers, setup=note_setup) as executor:
        first = [o.value for o in executor.run(noted, range(4))]
        second = [o.value for o in executor.run(noted_again, range(4))]
    assert len(set(first + second)) == 1
    assert len(first[0]) == 1


@pytest.mark.parametrize("workers", [1, 2])
def test_failing_setup_is_the_error_of_each_task(workers):
    with open_executor(workers=workers, setup=failing_setup) as executor:
        ended = outcomes(executor, square, [1, 2])
    assert [ended[k].error for k in (0, 1)] == ["OSError: no disk"] * 2


@pytest.mark.parametrize("workers", [1, 2])
def test_tasks_have_one_thread(executors, workers):
    assert outcomes(executors[workers], thread_numbers, [0])[0].value == (1, 1)


def test_workers_leave_the_terminal_and_receive_their_own_signals(executors):
    assert outcomes(executors[2], catches_its_signal, [0])[0].value == (True, True, True)


def test_interrupt_of_a_task_stops_all():
    with open_executor(workers=2) as executor, pytest.raises(KeyboardInterrupt):
        list(executor.run(interrupt, range(3)))


def test_values_that_cannot_travel_are_errors(executors):
    ended = outcomes(executors[2], value_that_cannot_travel, [0])
    assert "cannot be sent back" in ended[0].error
    ended = outcomes(executors[2], value_that_cannot_be_read, [0])
    assert "cannot be read (ValueError: invalid literal" in ended[0].error


def test_functions_and_tasks_that_cannot_travel_are_refused(executors):
    with pytest.raises(ValueError, match="expected a function of a module"):
        executors[2].run(lambda x: x, [1])
    with pytest.raises(ValueError, match="task 1: expected plain data"):
        executors[2].run(square, [1, lambda: 1])


@pytest.mark.parametrize("workers", [0, -1])
def test_number_of_workers_is_checked(workers):
    with pytest.raises(ValueError, match=f"workers = {workers}: expected 1 or more"), \
            open_executor(workers=workers):
        pass


# Workers that are killed.

def test_task_of_a_killed_worker_runs_again(executors, tmp_path):
    tasks = [(str(tmp_path), k, 2 if k == 3 else 0) for k in range(8)]
    ended = outcomes(executors[2], die_at_first, tasks)
    assert [ended[k].value for k in range(8)] == list(range(8))
    visits = [len(list((tmp_path / str(k)).iterdir())) for k in range(8)]
    assert visits == [1, 1, 1, 3, 1, 1, 1, 1]       # the others' work was not lost


def test_task_that_kills_its_workers_is_given_up(executors, tmp_path):
    tasks = [(str(tmp_path), k, 9 if k == 0 else 0) for k in range(4)]
    ended = outcomes(executors[2], die_at_first, tasks)
    assert ended[0].error == ("its worker process was killed (SIGKILL) 3 times, for want of memory "
                              "perhaps: try fewer workers")
    assert [ended[k].value for k in (1, 2, 3)] == [1, 2, 3]
    assert len(list((tmp_path / "0").iterdir())) == 3


def test_unguarded_script_ends_with_a_sentence(tmp_path):
    script = tmp_path / "unguarded.py"
    script.write_text("import operator\nfrom mpm_ref.executor import open_executor\n"
                      "with open_executor(workers=2) as executor:\n"
                      "    list(executor.run(operator.neg, [1, 2]))\n")
    done = subprocess.run([sys.executable, script], env=environment(), capture_output=True,
                          text=True, timeout=120)
    assert done.returncode == 1
    assert done.stderr.splitlines()[-1].startswith("RuntimeError: no worker process starts, the "
                                                   "last one ended with exit code 1: a script")


# Loops that are left early.

def test_break_stops_the_tasks_under_way(tmp_path):
    with open_executor(workers=3) as executor:
        for outcome in executor.run(await_stop_but_first, [(str(tmp_path), k) for k in range(9)]):
            numbers = process_numbers(tmp_path, 2)
            assert outcome.index == 0
            break
        assert all_end(numbers)
        stopped = len(list(tmp_path.glob("stopped-*")))
        assert stopped == len(list(tmp_path.glob("*.pid"))) <= 3        # the others did not begin
        assert [o.value for o in executor.run(square, [3])] == [9]      # it can be used again


def test_exception_ends_tasks_that_do_not_stop(tmp_path, monkeypatch):
    monkeypatch.setattr(worker, "GRACE", 0.2)
    wait, numbers = processes.wait, []

    def wait_or_fail(handles):
        if len(list(tmp_path.glob("*.pid"))) < 2:
            return wait(handles, 0.1)
        numbers.extend(process_numbers(tmp_path, 2))
        raise TimeoutError

    monkeypatch.setattr(processes, "wait", wait_or_fail)
    with open_executor(workers=2) as executor, pytest.raises(TimeoutError):
        next(executor.run(sleep_on, [(str(tmp_path), k) for k in range(2)]))
    assert all_end(numbers)


def test_no_stop_is_asked_in_the_callers_process():
    assert not stop_asked()


SCRIPT = """
    import signal
    import sys
    import executor_tasks
    from mpm_ref.executor import open_executor
    if __name__ == "__main__":
        signal.signal(signal.SIGINT, signal.default_int_handler)    # also where tests ignore it
        with open_executor(workers=2) as executor:
            tasks = [(sys.argv[1], k) for k in range(4)]
            for _ in executor.run(getattr(executor_tasks, sys.argv[2]), tasks):
                pass
"""


def environment():
    return os.environ | {"PYTHONPATH": f"{ROOT}{os.pathsep}{SUPPORT}"}


@contextmanager
def script(folder, task):
    """The process of the script, in a group of its own, once two of its tasks run."""
    file = folder / "script.py"
    file.write_text(textwrap.dedent(SCRIPT))
    process = subprocess.Popen([sys.executable, file, folder, task], env=environment(),
                               stderr=subprocess.PIPE, text=True, start_new_session=True)
    try:
        process_numbers(folder, 2)
        yield process
    finally:
        process.kill()
        process.communicate(timeout=60)


def test_ctrl_c_asks_tasks_to_stop(tmp_path):
    with script(tmp_path, "await_stop") as process:
        os.killpg(process.pid, signal.SIGINT)       # as a terminal does, to all of the group
        message = process.communicate(timeout=60)[1]
    assert message.splitlines()[-1] == "KeyboardInterrupt"
    assert message.count("Traceback") == 1          # no other process prints one
    assert all_end(process_numbers(tmp_path, 2))
    assert len(list(tmp_path.glob("stopped-*"))) == 2


def test_second_ctrl_c_kills_at_once(tmp_path):
    with script(tmp_path, "sleep_on") as process:
        for _ in range(2):
            os.killpg(process.pid, signal.SIGINT)
            time.sleep(1.0)
        process.communicate(timeout=worker.GRACE / 2)
    assert all_end(process_numbers(tmp_path, 2))


def test_workers_end_with_a_killed_parent(tmp_path):
    with script(tmp_path, "sleep_on") as process:
        process.kill()
    assert all_end(process_numbers(tmp_path, 2))


def test_same_bits_everywhere(executors):
    here, there = (outcomes(executors[workers], final_positions, [0.0, 0.5]) for workers in (1, 2))
    assert [here[k].value for k in (0, 1)] == [there[k].value for k in (0, 1)]
    assert here[0].value != here[1].value
