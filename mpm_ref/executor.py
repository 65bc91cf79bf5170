"""Stub until the executor is merged."""

from contextlib import contextmanager
from typing import NamedTuple


class TaskOutcome(NamedTuple):
    """Outcome."""

    index: int
    value: object
    error: object = None


class InProcess:
    """Stub."""

    workers = 1
    dashboard = None

    def run(self, function, tasks):
        """Run."""
        for k, task in enumerate(tasks):
            yield TaskOutcome(k, function(task))


@contextmanager
def open_executor(scheduler=None, workers=2, setup=None):
    """Stub."""
    yield InProcess()


def stop_asked():
    """Return whether the executor asks its tasks to stop."""
    return False
