"""Tasks on a dask cluster: of new local processes, and of a scheduler that runs by itself."""

import os
import signal
import subprocess
import sys
import textwrap
import time
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from types import SimpleNamespace

import pytest
from executor_scene import final_positions
from executor_tasks import (
    all_end,
    await_stop,
    await_stop_but_first,
    die_at_first,
    fail_on_odd,
    failing_setup,
    gather,
    interrupt,
    note_setup,
    noted,
    noted_again,
    process_numbers,
    sleep_on,
    square,
    thread_numbers,
    value_that_cannot_be_read,
    value_that_cannot_travel,
)

from mpm_ref.executor import (
    SchedulerLost,
    WorkerMismatch,
    cluster,
    dask_tasks,
    open_executor,
    tasks,
    versions,
)

pytest.importorskip("distributed")

import distributed
from dask_processes import dask_processes, environment


@pytest.fixture(scope="module")
def local():
    """An executor of two processes of a local cluster."""
    with open_executor("local:2") as executor:
        yield executor


@pytest.fixture(scope="module")
def remote(tmp_path_factory):
    """A scheduler with two workers."""
    with dask_processes(tmp_path_factory.mktemp("dask"), 2) as processes:
        yield processes


def outcomes(executor, function, tasks):
    """The outcomes by index; each task has one."""
    ended = list(executor.run(function, tasks))
    by_index = {outcome.index: outcome for outcome in ended}
    assert sorted(by_index) == list(range(len(tasks))) == sorted(o.index for o in ended)
    return by_index


def test_values_errors_and_threads(local):
    ended = outcomes(local, fail_on_odd, range(20))
    assert [ended[k].value for k in range(0, 20, 2)] == list(range(0, 20, 2))
    assert ended[3].error == "ValueError: 3 is odd"
    assert "in fail_on_odd" in ended[3].traceback
    assert outcomes(local, thread_numbers, [0])[0].value == (1, 1)
    assert outcomes(local, square, []) == {}
    assert local.workers == 2


def test_values_that_cannot_travel_are_errors(local):
    assert "cannot be sent back" in outcomes(local, value_that_cannot_travel, [0])[0].error
    assert "cannot be read" in outcomes(local, value_that_cannot_be_read, [0])[0].error
    with pytest.raises(ValueError, match="expected a function of a module"):
        local.run(lambda x: x, [1])


def test_interrupt_of_a_task_stops_all(local):
    with pytest.raises(KeyboardInterrupt):
        list(local.run(interrupt, range(3)))


def test_dashboard_needs_bokeh(local, monkeypatch):
    monkeypatch.setattr(cluster, "has_dashboard", lambda: False)
    assert local.dashboard is None
    monkeypatch.setattr(cluster, "has_dashboard", lambda: True)
    assert local.dashboard.startswith("http://127.0.0.1:")


def test_tasks_of_killed_workers_run_again(local, tmp_path):
    deaths = {0: 9, 3: 1}
    ended = outcomes(local, die_at_first,
                     [(str(tmp_path), k, deaths.get(k, 0)) for k in range(8)])
    assert ended[0].error.startswith("its workers were killed, each time that it was tried, for ")
    assert [ended[k].value for k in range(1, 8)] == list(range(1, 8))
    visits = [len(list((tmp_path / str(k)).iterdir())) for k in range(8)]
    assert visits[0] == 3
    assert visits[3] >= 2       # one more each time that its worker is killed with its value


def test_break_stops_the_tasks_under_way(local, tmp_path):
    for outcome in local.run(await_stop_but_first, [(str(tmp_path), k) for k in range(9)]):
        process_numbers(tmp_path, 1)
        assert outcome.index == 0
        break
    stopped = len(list(tmp_path.glob("stopped-*")))
    assert stopped == len(list(tmp_path.glob("*.pid"))) <= 2        # the others did not begin
    assert outcomes(local, square, [3])[0].value == 9               # it can be used again


def test_same_bits_as_here(local, remote):
    with open_executor(workers=1) as executor:
        here = outcomes(executor, final_positions, [0.0, 0.5])
    there = outcomes(local, final_positions, [0.0, 0.5])
    with open_executor(remote.address) as executor:
        far = outcomes(executor, final_positions, [0.0, 0.5])
    assert [here[k].value for k in (0, 1)] == [there[k].value for k in (0, 1)]
    assert [here[k].value for k in (0, 1)] == [far[k].value for k in (0, 1)]


@pytest.mark.slow
def test_eight_workers_perform_tasks_at_a_time(tmp_path):
    with open_executor("local:8") as executor:
        ended = outcomes(executor, gather, [(str(tmp_path), 8)] * 16)
        assert executor.workers == 8
    assert len(numbers := {outcome.value for outcome in ended.values()}) == 8
    assert all_end(numbers)


SCRIPT = """
    import signal
    import sys
    import executor_tasks
    from mpm_ref.executor import open_executor
    if __name__ == "__main__":
        signal.signal(signal.SIGINT, signal.default_int_handler)    # also where tests ignore it
        with open_executor("local:2") as executor:
            for _ in executor.run(executor_tasks.await_stop, [(sys.argv[1], k) for k in range(4)]):
                pass
"""


@contextmanager
def script(folder, scheduler):
    """The process of the script, in a group of its own, once its tasks run."""
    file = folder / "script.py"
    file.write_text(textwrap.dedent(SCRIPT).replace("local:2", scheduler))
    process = subprocess.Popen([sys.executable, file, folder], env=environment(),
                               stderr=subprocess.PIPE, text=True, start_new_session=True)
    try:
        process_numbers(folder, 2)
        yield process
    finally:
        process.kill()
        process.communicate(timeout=60)


def test_local_cluster_ends_with_its_command(tmp_path):
    with script(tmp_path, "local:2") as process:
        process.kill()
    assert all_end(process_numbers(tmp_path, 2))


def test_ctrl_c_stops_tasks_of_a_local_cluster(tmp_path):
    with script(tmp_path, "local:2") as process:
        os.killpg(process.pid, signal.SIGINT)       # as a terminal does, to all of the group
        message = process.communicate(timeout=60)[1]
    assert message.splitlines()[-1] == "KeyboardInterrupt"
    assert message.count("Traceback") == 1          # no other process prints one
    assert len(list(tmp_path.glob("stopped-*"))) == 2
    assert all_end(process_numbers(tmp_path, 2))


def test_processes_of_tasks_that_do_not_stop_are_ended(tmp_path, monkeypatch):
    monkeypatch.setattr(cluster, "GRACE", 0.5)
    with open_executor("local:1") as executor:
        loop = executor.run(first_or_sleep, [(str(tmp_path), k) for k in range(2)])
        assert next(loop).value == 0
        numbers = process_numbers(tmp_path, 1)
    assert all_end(numbers)


def first_or_sleep(task):
    return 0 if task[1] == 0 else sleep_on(task)


# A scheduler that runs by itself.

def test_two_commands_share_workers(remote):
    with open_executor(remote.address) as one, open_executor(remote.address) as two:
        assert one.workers == two.workers == 2
        loops = one.run(square, range(6)), two.run(square, range(6, 12))
        values = [sorted(outcome.value for outcome in loop) for loop in loops]
    assert values == [[k * k for k in range(6)], [k * k for k in range(6, 12)]]


def test_setup_runs_once_in_each_worker(remote):
    with open_executor(remote.address, setup=note_setup) as executor:
        for function in (noted, noted_again):
            values = [outcome.value for outcome in executor.run(function, range(4))]
            assert values == [(0,)] * 4
    with open_executor(remote.address, setup=failing_setup) as executor:
        assert outcomes(executor, square, [1])[0].error == "OSError: no disk"


def test_break_asks_tasks_of_remote_workers_to_stop(remote, tmp_path):
    with open_executor(remote.address) as executor:
        for _ in executor.run(await_stop_but_first, [(str(tmp_path), k) for k in range(9)]):
            process_numbers(tmp_path, 1)
            break
    assert len(list(tmp_path.glob("stopped-*"))) == len(list(tmp_path.glob("*.pid"))) <= 2


def test_tasks_stop_when_their_client_is_killed(remote, tmp_path):
    with script(tmp_path, remote.address) as process:
        process.kill()
    assert wait_for_files(tmp_path, "stopped-*", 2)


def wait_for_files(folder, pattern, count):
    """Return whether so many files come soon."""
    latest = time.monotonic() + 30.0
    while len(list(Path(folder).glob(pattern))) != count and time.monotonic() < latest:
        time.sleep(0.05)
    return len(list(Path(folder).glob(pattern))) == count


def test_killed_worker_and_killed_scheduler(tmp_path):
    """The task of a killed worker runs on the other one; without a scheduler the loop ends."""
    with dask_processes(tmp_path, 2) as processes, open_executor(processes.address) as executor:
        loop = executor.run(await_stop_but_first, [(str(tmp_path), k) for k in range(4)])
        assert next(loop).index == 0
        process_numbers(tmp_path, 2)
        processes.workers[0].kill()
        processes.workers[0].wait()
        processes.workers[1].send_signal(signal.SIGTERM)        # its tasks begin again elsewhere
        assert wait_for_files(tmp_path, "stopped-*", 1)
        processes.start_worker()
        processes.workers[1].wait(timeout=60)
        for file in (*tmp_path.glob("*.pid"), *tmp_path.glob("stopped-*")):
            file.unlink()
        process_numbers(tmp_path, 1)
        processes.scheduler.kill()
        with pytest.raises(SchedulerLost, match=f"{processes.address} has gone: finished results "
                           "are kept, and the same command goes on"):
            next(loop)
        processes.workers[2].wait(timeout=60)
        assert len(list(tmp_path.glob("stopped-*"))) == 1


@pytest.mark.parametrize("is_closing", [False, True])
def test_task_of_a_closing_worker_begins_again_elsewhere(is_closing, monkeypatch):
    status = distributed.Status.closing if is_closing else distributed.Status.running
    state = SimpleNamespace(nthreads=1, tasks={"key": SimpleNamespace(state="executing")})
    worker = SimpleNamespace(status=status, state=state, address="tcp://a:1",
                             get_current_task=lambda: "key")
    monkeypatch.setattr(distributed, "get_worker", lambda: worker)
    perform = partial(dask_tasks.perform_on_worker, tasks.pack_job(square, None),
                      versions.versions(), *tasks.pack_tasks([3]))
    if is_closing:
        with pytest.raises(distributed.Reschedule):
            perform()
    else:
        assert tasks.unpack(0, perform()).value == 9


def test_scheduler_that_does_not_answer(remote, monkeypatch, tmp_path):
    monkeypatch.setattr(cluster, "CHECK", 0.1)
    monkeypatch.setattr(cluster, "ANSWER", 0.5)
    monkeypatch.setattr(cluster, "GRACE", 0.1)
    with open_executor(remote.address) as executor:
        loop = executor.run(await_stop_but_first, [(str(tmp_path), k) for k in range(4)])
        next(loop)
        remote.scheduler.send_signal(signal.SIGSTOP)
        try:
            with pytest.raises(SchedulerLost, match="does not answer"):
                next(loop)
        finally:
            remote.scheduler.send_signal(signal.SIGCONT)
    assert wait_for_files(tmp_path, "stopped-*", len(list(tmp_path.glob("*.pid"))))


def test_run_does_not_wait_for_workers_for_ever(tmp_path, monkeypatch):
    monkeypatch.setattr(cluster, "CHECK", 0.1)
    monkeypatch.setattr(cluster, "ALONE", 0.3)
    with dask_processes(tmp_path, 1) as processes, open_executor(processes.address) as executor:
        loop = executor.run(await_stop, [(str(tmp_path), 0)])
        processes.workers[0].kill()
        processes.workers[0].wait()
        with pytest.raises(SchedulerLost, match=r"has had no worker for 0\.3 s"):
            next(loop)


def test_scheduler_without_workers(tmp_path, monkeypatch):
    monkeypatch.setattr(cluster, "FIRST", 0.2)
    with dask_processes(tmp_path, 0) as processes, \
            pytest.raises(ValueError, match=r"no worker connected within 0\.2 s; start some with "
                          f"`dask worker {processes.address}"), open_executor(processes.address):
        pass


def test_no_scheduler(monkeypatch):
    monkeypatch.setattr(cluster, "CONNECT", 0.5)
    with pytest.raises(ValueError, match="no dask scheduler answers there"), \
            open_executor("tcp://127.0.0.1:9"):
        pass


# Software of workers.

def test_worker_with_several_threads_is_refused(tmp_path):
    with dask_processes(tmp_path, 0) as processes:
        processes.start_worker("--nthreads", "2")
        with pytest.raises(ValueError, match="performs 2 tasks at a time in one process: start"), \
                open_executor(processes.address):
            pass


def test_worker_without_mpm_ref_is_refused(tmp_path):
    with dask_processes(tmp_path, 0) as processes:
        processes.start_worker(PYTHONPATH=hiding(tmp_path))
        with pytest.raises(ValueError, match=r"worker tcp://\S+ cannot import mpm_ref .*hidden"), \
                open_executor(processes.address):
            pass


def hiding(folder):
    """A path with a package mpm_ref that raises."""
    package = folder / "hidden" / "mpm_ref"
    package.mkdir(parents=True)
    (package / "__init__.py").write_text("raise ImportError('hidden')\n")
    return str(package.parent)


def test_worker_with_other_versions_is_refused(remote, monkeypatch):
    here = versions.versions() | {"numba": "0.1"}
    monkeypatch.setattr(cluster, "versions", lambda: here)
    with pytest.raises(ValueError, match=r"worker tcp://\S+ has numba [\d.]+, not 0\.1 as here"), \
            open_executor(remote.address):
        pass


def test_worker_with_other_versions_that_comes_later_is_refused(local, monkeypatch):
    here = versions.versions() | {"mpm_ref": "9"}
    monkeypatch.setattr(cluster, "versions", lambda: here)
    with pytest.raises(WorkerMismatch, match=r"has mpm_ref [\d.]+, not 9 as here: install"):
        list(local.run(square, [1]))


def test_source_hash_depends_on_each_file(tmp_path, monkeypatch):
    for name in ("a", "b"):
        (tmp_path / f"{name}.py").write_text("")
    (tmp_path / "executor").mkdir()
    monkeypatch.setattr(versions, "__file__", str(tmp_path / "executor" / "versions.py"))
    hashes = [versions.source_hash()]
    (tmp_path / "b.py").write_text("1")
    hashes.append(versions.source_hash())
    (tmp_path / "b.py").rename(tmp_path / "c.py")
    hashes.append(versions.source_hash())
    assert len(set(hashes)) == 3
