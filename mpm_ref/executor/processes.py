"""Perform tasks in this process, or in several new processes of this machine.

A killed worker process costs the task that it performed and no other: `concurrent.futures` gives up
all tasks under way then, and `multiprocessing.Pool` waits for ever.
"""

import threading
from collections import Counter, deque
from functools import partial
from multiprocessing.connection import wait
from queue import SimpleQueue

from .tasks import ATTEMPTS, TaskOutcome, pack_job, pack_tasks, perform, unpack
from .worker import CONTEXT, READY, WorkerProcess, end_all, shared_stop


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
        self.workers, self._setup = workers, setup
        self._members, self._stop, self._dispatcher = [], None, None
        self._failed_starts = 0

    def run(self, function, tasks):
        """Yield the `TaskOutcome` of function(task) for each task, as they end.

        The task of a killed process begins again in a new one, at most ATTEMPTS times in all. A
        caller that leaves the loop early asks the tasks under way to stop, and their processes end.
        Raises ValueError for a function or a task that cannot be sent, RuntimeError where no
        process starts.
        """
        return self._outcomes(_Batch(pack_job(function, self._setup), pack_tasks(tasks)))

    def _outcomes(self, batch):
        remaining = len(batch.tasks)
        try:
            self._begin(batch)
            while remaining:
                outcome = batch.ended.get()
                if isinstance(outcome, BaseException):
                    raise outcome
                remaining -= 1
                yield outcome
        finally:
            if remaining:
                self.close()

    def _begin(self, batch):
        """Start processes as needed, and the thread that sends them the tasks of a batch."""
        if self._dispatcher is not None:
            self._dispatcher.join()
        if self._stop is None:
            self._stop, self._failed_starts = shared_stop(), 0
            self._woken, self._wake = CONTEXT.Pipe(duplex=False)
        while len(self._members) < min(self.workers, len(batch.tasks)):
            self._members.append(WorkerProcess(self._stop))
        self._dispatcher = threading.Thread(target=self._dispatch, args=(batch,), daemon=True)
        self._dispatcher.start()

    def _dispatch(self, batch):
        """Send tasks and receive outcomes until the batch ends or `close` wakes this thread."""
        try:
            while batch.is_under_way:
                for member in self._members:
                    if batch.pending and member.is_idle:
                        member.send(*batch.take())
                handles = [handle for member in self._members for handle in member.handles]
                news = set(wait([*handles, self._woken]))
                if self._woken in news:
                    return
                for member in list(self._members):
                    if news.intersection(member.handles):
                        self._attend(member, batch)
        except BaseException as error:
            batch.ended.put(error)

    def _attend(self, member, batch):
        """Take the message of a member with news, or put a new one in its place if it died."""
        message = member.receive()
        if message == READY and not member.is_ready:
            member.is_ready, self._failed_starts = True, 0
            return
        index, member.index = member.index, None
        if message is not None:
            batch.end(unpack(index, message))
            return
        reason = self._replace(member)
        if index is not None and not batch.puts_back(index):
            batch.end(TaskOutcome(index, error=f"its worker process {reason} {ATTEMPTS} times, for "
                                  "want of memory perhaps: try fewer workers"))

    def _replace(self, member):
        """Put a new process in the place of one that ended, and return how that ended."""
        reason = member.end_text()
        self._failed_starts += not member.is_ready
        if self._failed_starts >= ATTEMPTS:
            raise RuntimeError(
                f"no worker process starts, the last one {reason}: a script that opens an executor "
                'needs `if __name__ == "__main__":` around its commands')
        self._members[self._members.index(member)] = WorkerProcess(self._stop)
        return reason

    def close(self):
        """End all processes: tasks under way are asked to stop, and killed if they do not."""
        if self._stop is None:
            return
        self._stop.value, self._stop = 1, None
        self._wake.send_bytes(b"")
        if self._dispatcher is not None:
            self._dispatcher.join()
        for end in (self._wake, self._woken):
            end.close()
        members, self._members = self._members, []
        end_all(members)


class _Batch:
    """A job, its tasks, those that no process has, their attempts, and a queue of outcomes."""

    def __init__(self, job, tasks):
        self.job, self.tasks = job, tasks
        self.pending, self.attempts = deque(range(len(tasks))), Counter()
        self.ended, self._remaining = SimpleQueue(), len(tasks)

    @property
    def is_under_way(self):
        """Return whether tasks have not ended."""
        return self._remaining > 0

    def end(self, outcome):
        """Pass on the outcome of a task."""
        self._remaining -= 1
        self.ended.put(outcome)

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
