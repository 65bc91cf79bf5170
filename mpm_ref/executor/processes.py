"""Perform tasks in this process, or in several new processes of this machine.

A worker process has a pipe of its own, so that a killed one costs the task that it performed and no
other: `concurrent.futures` and `multiprocessing.Pool` give up all tasks under way, or hang.
"""

import multiprocessing
import os
import signal
import threading
import time
from collections import Counter, deque
from contextlib import contextmanager, suppress
from functools import partial
from multiprocessing.connection import wait

from .tasks import (
    ATTEMPTS,
    TaskOutcome,
    pack_job,
    pack_tasks,
    perform,
    perform_packed,
    set_stop_source,
    unpack,
)

READY = b"ready"
GRACE = 30.0        # [s] that a task has to stop, and to end after SIGTERM, before it is killed
THREADS = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")


class SameProcess:
    """An executor that performs tasks here, each when the caller asks for its outcome."""

    workers, dashboard = 1, None

    def __init__(self, setup=None):
        self._setup = setup

    def run(self, function, tasks):
        """Yield the `TaskOutcome` of function(task) for each task."""
        for index, task in enumerate(tasks):
            yield TaskOutcome(index, *perform(partial(self._call, function), task))

    def _call(self, function, task):
        """Return function(task), after the setup."""
        if self._setup is not None:
            self._setup()
            self._setup = None
        return function(task)

    def close(self):
        """Do nothing: there is nothing to end."""


class LocalProcesses:
    """An executor of several new processes ("spawn") with one thread each.

    They begin with the first task, and end with the executor or with this process, however that
    ends. Ctrl-C reaches this process alone.
    """

    dashboard = None

    def __init__(self, workers, setup=None):
        self.workers, self._setup, self._members = workers, setup, []
        self._context = multiprocessing.get_context("spawn")
        self._stop, self._failed_starts = None, 0

    def run(self, function, tasks):
        """Yield the `TaskOutcome` of function(task) for each task, as they end.

        The task of a killed process begins again in a new one, at most ATTEMPTS times in all. A
        caller that leaves the loop early asks the tasks under way to stop, and their processes end.
        Raises ValueError for a function or a task that cannot be sent, RuntimeError where no
        process starts.
        """
        return self._outcomes(_Batch(pack_job(function, self._setup), pack_tasks(tasks)))

    def _outcomes(self, batch):
        try:
            self._start(min(self.workers, batch.remaining))
            while batch.remaining:
                self._assign(batch)
                for member in self._members_with_news():
                    outcome = self._outcome(member, batch)
                    if outcome is not None:
                        self._assign(batch)
                        batch.remaining -= 1
                        yield outcome
        finally:
            if batch.remaining:
                self.close()

    def _assign(self, batch):
        """Send pending tasks to idle members."""
        for member in self._members:
            if batch.pending and member.is_idle:
                member.send(*batch.take())

    def _members_with_news(self):
        """Wait, and return the members whose processes sent something or ended."""
        news = set(wait([handle for member in self._members for handle in member.handles]))
        return [member for member in self._members if news.intersection(member.handles)]

    def _outcome(self, member, batch):
        """Return the `TaskOutcome` of a member with news, or None if no task came to its end."""
        message = member.receive()
        if message == READY and not member.is_ready:
            member.is_ready, self._failed_starts = True, 0
            return None
        index, member.index = member.index, None
        if message is not None:
            return unpack(index, message)
        end = self._replace(member)
        if index is None or batch.puts_back(index):
            return None
        return TaskOutcome(index, error=f"its worker process {end} {ATTEMPTS} times, for want of "
                           "memory perhaps: try fewer workers")

    def _replace(self, member):
        """Put a new process in the place of one that ended, and return how that ended."""
        end = member.end_text()
        self._failed_starts += not member.is_ready
        if self._failed_starts >= ATTEMPTS:
            raise RuntimeError(f"no worker process starts, the last one {end}: a script that opens "
                               'an executor needs `if __name__ == "__main__":` around its commands')
        self._members[self._members.index(member)] = _Member(self._context, self._stop)
        return end

    def _start(self, count):
        """Start processes until there are `count` of them."""
        if self._stop is None:
            self._stop = self._context.RawValue("b", 0)     # no lock, which a killed process keeps
        while len(self._members) < count:
            self._members.append(_Member(self._context, self._stop))

    def close(self):
        """End all processes: tasks under way are asked to stop, and killed after GRACE."""
        members, self._members = self._members, []
        if self._stop is not None:
            self._stop.value = 1
            self._stop = None
        for member in members:
            member.connection.close()
        try:
            for act in (None, "terminate", "kill"):
                _end(members, act)
        except BaseException:           # the second Ctrl-C
            _end(members, "kill")
            raise


class _Batch:
    """A job, its tasks, and the numbers of those that no process has, with their attempts."""

    def __init__(self, job, tasks):
        self.job, self.tasks = job, tasks
        self.pending, self.remaining = deque(range(len(tasks))), len(tasks)
        self.attempts = Counter()

    def take(self):
        """Return the index, the job and the task that come next."""
        index = self.pending.popleft()
        self.attempts[index] += 1
        return index, self.job, self.tasks[index]

    def puts_back(self, index):
        """Put back a task whose process was killed; return False if it had all its attempts."""
        if self.attempts[index] >= ATTEMPTS:
            return False
        self.pending.append(index)
        return True


def _end(members, act):
    """Call a method of the processes that are alive, and wait for all at most GRACE."""
    latest = time.monotonic() + GRACE
    for member in members:
        if act is not None and member.process.is_alive():
            getattr(member.process, act)()
    for member in members:
        member.process.join(max(latest - time.monotonic(), 0.0))


class _Member:
    """A worker process, the pipe to it, and the index of the task that it performs or None."""

    def __init__(self, context, stop):
        self.connection, other_end = context.Pipe()
        self.process = context.Process(target=serve, args=(other_end, stop))
        with ignored_interrupts():
            self.process.start()
        other_end.close()
        self.handles = (self.connection, self.process.sentinel)
        self.is_ready, self.index = False, None

    @property
    def is_idle(self):
        """Whether the process waits for a task."""
        return self.is_ready and self.index is None

    def send(self, index, job, task):
        """Send a task. The death of the process is noticed later, by `receive`."""
        self.index = index
        with suppress(OSError):
            self.connection.send_bytes(job)
            self.connection.send_bytes(task)

    def receive(self):
        """Return the bytes that the process sent, or None if it died."""
        with suppress(EOFError, OSError):
            if self.connection.poll():
                return self.connection.recv_bytes()
        return None

    def end_text(self):
        """Wait for the end of the process, and return the cause in words."""
        self.connection.close()
        self.process.join()
        code = self.process.exitcode
        if code < 0:
            return f"was killed ({signal.Signals(-code).name})"
        return f"ended with exit code {code}"


@contextmanager
def ignored_interrupts():
    """Keep processes that start in this block from receiving Ctrl-C before they are set up."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


def serve(connection, stop):
    """Perform tasks from a connection until its other end closes, in a process of its own."""
    def end_with_parent():
        wait([multiprocessing.parent_process().sentinel])
        os._exit(1)         # at any moment: files are complete at any

    os.setpgrp()            # Ctrl-C of the terminal goes to the parent alone
    os.environ.update(THREADS)      # libraries that are loaded later read them
    set_stop_source(lambda: stop.value)
    threading.Thread(target=end_with_parent, daemon=True).start()
    with suppress(EOFError, OSError):       # the parent closed the pipe
        connection.send_bytes(READY)
        while True:
            job, task = connection.recv_bytes(), connection.recv_bytes()
            connection.send_bytes(perform_packed(job, task))
