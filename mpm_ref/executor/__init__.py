"""Perform many independent tasks in this process, in several, or on several machines.

    with open_executor(scheduler, workers) as executor:
        for outcome in executor.run(function, tasks):
            outcome.index, outcome.value, outcome.error

The function is one of a module, of one argument, which is plain data. A task has one thread, and
its result is the same to the last bit wherever it ran. A long task calls `stop_asked()` now and
then, and returns early if that is true. Scripts that open an executor need
`if __name__ == "__main__":` around their commands, since new processes import them.

`tasks` performs one task, `processes` and `worker` have the processes of this machine, `cluster`
and `dask_tasks` those of a dask cluster, whose `versions` must be those of this process.
"""

import re
from contextlib import contextmanager

from .cluster import SchedulerLost, connect, open_local_cluster
from .processes import LocalProcesses, SameProcess
from .tasks import TaskOutcome, stop_asked
from .versions import BadScheduler, WorkerMismatch

__all__ = ["BadScheduler", "SchedulerLost", "TaskOutcome", "WorkerMismatch", "open_executor",
           "stop_asked"]

LOCAL = re.compile(r"local:0*([1-9]\d*)", re.ASCII)
ADDRESS = re.compile(r"(tcp|tls|ucx|ws|wss)://\S+:\d+", re.ASCII)


@contextmanager
def open_executor(scheduler=None, workers=2, setup=None):
    """Open an executor with the generator run(function, tasks), `workers` and `dashboard`.

    Args:
        scheduler: None for new processes of this machine; "local:N" for a dask cluster of N of
            them; else the address of a dask scheduler, such as "tcp://host:8786".
        workers: number of new processes without a scheduler; 1 performs the tasks in this process.
        setup: function of a module without arguments, which each process calls before its tasks.

    Raises ValueError for a bad number of workers, and its subclass `BadScheduler` for a bad text,
    for dask that is not installed, for a scheduler that does not answer or has no workers, and for
    workers with other versions of the software than this process.
    """
    executor = _executor(scheduler, workers, setup)
    try:
        yield executor
    finally:
        executor.close()


def _executor(scheduler, workers, setup):
    if scheduler is None:
        if workers < 1:
            raise ValueError(f"workers = {workers}: expected 1 or more")
        return SameProcess(setup) if workers == 1 else LocalProcesses(workers, setup)
    if match := LOCAL.fullmatch(scheduler):
        return open_local_cluster(int(match[1]), setup)
    if ADDRESS.fullmatch(scheduler):
        return connect(scheduler, setup)
    raise BadScheduler(
        f"scheduler {scheduler!r}: expected local:N for N processes of this machine, as in "
        "local:4, or the address of a dask scheduler, as in tcp://host:8786")
