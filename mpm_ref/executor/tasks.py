"""Perform one task: the same on every executor, with one thread, and errors as text.

A job is a function, with a setup that each process calls once; a task is the function's argument.
Both travel as bytes, and so does the reply, so that whatever cannot travel is an error of its task.
"""

import pickle
import traceback
from collections.abc import Callable
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache, lru_cache

import numba
import threadpoolctl

ATTEMPTS = 3        # of a task whose worker process is killed


@dataclass(frozen=True)
class TaskOutcome:
    """The end of a task: its index, and the function's value or an error."""

    index: int
    value: object = None
    error: str | None = None        # a sentence
    traceback: str | None = None    # where the function raised the error


class _Stop:
    """Hold the function that says whether the executor of this process asks tasks to stop."""

    asked: Callable | None = None


def stop_asked():
    """Return whether the executor asks the task that calls it to stop: its caller left the loop.

    False in the caller's own process, which Ctrl-C interrupts itself.
    """
    return _Stop.asked is not None and bool(_Stop.asked())


def set_stop_source(asked):
    """Let `stop_asked` return asked() in this process."""
    _Stop.asked = asked


def perform(function, task):
    """Return (value, error, traceback) of function(task), which runs with one thread.

    KeyboardInterrupt alone is raised; another exception becomes its type and text.
    """
    try:
        with single_thread():
            return function(task), None, None
    except KeyboardInterrupt:
        raise
    except BaseException as error:      # SystemExit too ends the task alone
        return None, sentence(error), "".join(traceback.format_exception(error))


def sentence(error):
    """Return an exception's type and text in one line."""
    return " ".join(f"{type(error).__name__}: {error}".split()).removesuffix(":")


@contextmanager
def single_thread():
    """Limit kernels and BLAS to one thread in this block."""
    before = numba.get_num_threads()
    numba.set_num_threads(1)
    try:
        with threadpoolctl.threadpool_limits(1):
            yield
    finally:
        numba.set_num_threads(before)


def pack_job(function, setup):
    """Return a job as bytes. Raises ValueError where its functions cannot be sent to a process."""
    for one in filter(None, (function, setup)):
        try:
            pickle.dumps(one)
        except Exception as error:
            raise ValueError(f"{one}: expected a function of a module, as others cannot be sent "
                             f"to another process ({sentence(error)})") from None
    return pickle.dumps((pickle.dumps(function), pickle.dumps(setup)))


def pack_tasks(tasks):
    """Return tasks as a list of bytes. Raises ValueError for one that cannot be sent."""
    packed = []
    for index, task in enumerate(tasks):
        try:
            packed.append(pickle.dumps(task))
        except Exception as error:
            raise ValueError(f"task {index}: expected plain data, which can be sent to another "
                             f"process ({sentence(error)})") from None
    return packed


@lru_cache(maxsize=1)
def load_job(job):
    """Return the function of a job, whose setup has been called in this process."""
    function, setup = pickle.loads(job)
    call_setup(setup)
    return pickle.loads(function)


@cache
def call_setup(packed):
    """Call a setup, once in this process unless it raises."""
    setup = pickle.loads(packed)
    if setup is not None:
        setup()


def perform_packed(job, task):
    """Return the packed (value, error, traceback) of a job and a task in bytes.

    Empty if the function raised KeyboardInterrupt.
    """
    try:
        reply = perform(lambda text: load_job(job)(pickle.loads(text)), task)
    except KeyboardInterrupt:
        return b""
    try:
        return pickle.dumps(reply)
    except Exception as error:
        text = f"the task's value cannot be sent back ({sentence(error)})"
        return pickle.dumps((None, text, None))


def unpack(index, reply):
    """Return the `TaskOutcome` of a packed reply. Raises KeyboardInterrupt for an empty one."""
    if not reply:
        raise KeyboardInterrupt
    try:
        return TaskOutcome(index, *pickle.loads(reply))
    except Exception as error:
        return TaskOutcome(index, error=f"the task's value cannot be read ({sentence(error)})")
