"""Functions that the tests of executors send to other processes."""

import os
import signal
import sys
import time
from pathlib import Path

import numba
import threadpoolctl

from mpm_ref.executor import stop_asked

NUMBERS = []        # of `note_setup`


def square(x):
    return x * x


def fail_on_odd(x):
    if x % 2:
        raise ValueError(f"{x} is\nodd")
    return x


def exit_on_odd(x):
    if x % 2:
        sys.exit(3)
    return x


def value_that_cannot_travel(x):
    return lambda: x


class Refusing:
    """An object that can be sent and not received."""

    def __reduce__(self):
        return int, ("no number",)


def value_that_cannot_be_read(x):
    return Refusing()


def interrupt(x):
    raise KeyboardInterrupt


def catches_its_signal(x):
    """Return whether the process receives SIGINT from itself, as runs that stop do."""
    received = []
    before = signal.signal(signal.SIGINT, lambda *_: received.append(x))
    signal.raise_signal(signal.SIGINT)
    signal.signal(signal.SIGINT, before)
    return received == [x], before == signal.SIG_IGN, os.getpgrp() == os.getpid()


def note_setup():
    NUMBERS.append(len(NUMBERS))


def noted(x):
    return tuple(NUMBERS)


def noted_again(x):
    return tuple(NUMBERS)


def failing_setup():
    raise OSError("no disk")


def process_number(x):
    return os.getpid()


def gather(task):
    """Return the number of this process once `count` processes have come to this task."""
    folder, count = task
    (Path(folder) / f"{os.getpid()}.here").touch()
    latest = time.monotonic() + 60.0
    while len(list(Path(folder).glob("*.here"))) < count and time.monotonic() < latest:
        time.sleep(0.02)
    return os.getpid()


def thread_numbers(x):
    pools = [pool["num_threads"] for pool in threadpoolctl.threadpool_info()
             if pool["user_api"] == "blas"]
    return numba.get_num_threads(), max(pools)


def count_visit(folder, name):
    """Count a call in a folder of empty files, and return the number of calls."""
    visits = Path(folder) / name
    visits.mkdir(exist_ok=True)
    (visits / f"{time.time_ns()}-{os.getpid()}").touch()
    return len(list(visits.iterdir()))


def die_at_first(task):
    """Kill the process at the first `deaths` visits of the task, then return its index."""
    folder, index, deaths = task
    if count_visit(folder, str(index)) <= deaths:
        os.kill(os.getpid(), signal.SIGKILL)
    return index


def await_stop(task):
    """Write the number of this process, wait until a stop is asked for, and leave a mark."""
    folder, index = task
    announce(folder, index)
    while not stop_asked():
        time.sleep(0.01)
    (Path(folder) / f"stopped-{index}").touch()
    return index


def await_stop_but_first(task):
    """Return at once for index 0, else as `await_stop`."""
    return 0 if task[1] == 0 else await_stop(task)


def sleep_on(task):
    """Write the number of this process, and sleep, whatever is asked."""
    folder, index = task
    announce(folder, index)
    time.sleep(600.0)


def announce(folder, index):
    """Write the number of this process into a file, at once."""
    file = Path(folder) / f"{index}.part"
    file.write_text(str(os.getpid()))
    file.rename(Path(folder) / f"{index}.pid")


def process_numbers(folder, count, seconds=60.0):
    """Wait for the files of `announce`, and return the numbers of processes in them."""
    latest = time.monotonic() + seconds
    while len(files := sorted(Path(folder).glob("*.pid"))) < count:
        assert time.monotonic() < latest, "the tasks did not begin"
        time.sleep(0.02)
    return [int(file.read_text()) for file in files]


def exists(number):
    """Return whether there is a process of that number."""
    try:
        os.kill(number, 0)
    except ProcessLookupError:
        return False
    return True


def all_end(numbers, seconds=20.0):
    """Wait until no process of these numbers is left; return whether that happens in time."""
    latest = time.monotonic() + seconds
    while left := [number for number in numbers if exists(number)]:
        if time.monotonic() > latest:
            return not left
        time.sleep(0.02)
    return True
