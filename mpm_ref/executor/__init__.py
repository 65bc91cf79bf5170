"""Perform many independent tasks in this process, in several, or on several machines.

    with open_executor(scheduler, workers) as executor:
        for outcome in executor.run(function, tasks):
            outcome.index, outcome.value, outcome.error

`tasks` has the loops of one task, `processes` those of this machine. The function is one of a
module, of one argument, which is plain data. A task has one thread, and its result is the same to
the last bit wherever it ran. A long task calls `stop_asked()` now and then, and returns early if
that is true. Scripts that open an executor need `if __name__ == "__main__":` around their commands,
since new processes import them.
"""

from contextlib import contextmanager

from .processes import LocalProcesses, SameProcess
from .tasks import TaskOutcome, stop_asked

__all__ = ["TaskOutcome", "open_executor", "stop_asked"]


@contextmanager
def open_executor(scheduler=None, workers=2, setup=None):
    """Open an executor with the generator run(function, tasks), `workers` and `dashboard`.

    Args:
        scheduler: None for this machine.
        workers: number of new processes on this machine; 1 performs the tasks in this process.
        setup: function of a module without arguments, which each process calls before its tasks.

    Raises ValueError for a bad value.
    """
    if workers < 1:
        raise ValueError(f"workers = {workers}: expected 1 or more")
    executor = SameProcess(setup) if workers == 1 else LocalProcesses(workers, setup)
    try:
        yield executor
    finally:
        executor.close()
