"""Perform one task in a dask worker. `cluster` sends these functions there."""

from .tasks import perform_packed, set_stop_source
from .versions import WorkerMismatch, disagreement, versions

STOPPED = ("cancelled", "resumed")      # states of a running task that nobody awaits


def worker_facts(dask_worker):
    """Return (versions, number of threads) of a worker, which dask passes."""
    return versions(), dask_worker.state.nthreads


def count_tasks(run, dask_worker):
    """Return the number of tasks of a run that a worker, which dask passes, performs."""
    return sum(task.key[0] == run for task in dask_worker.state.executing)


def perform_on_worker(job, expected, task):
    """Return the packed reply of a job and a task, in a worker.

    The task is asked to stop when its client cancels it or leaves, and when the worker closes; in
    the last case it begins again on another one. Raises `WorkerMismatch` where the worker's
    versions are not those expected.
    """
    import distributed

    worker = distributed.get_worker()
    reason = disagreement(worker.address, worker_facts(worker), expected)
    if reason:
        raise WorkerMismatch(reason)
    key = worker.get_current_task()

    def is_cancelled():
        state = worker.state.tasks.get(key)
        return state is None or state.state in STOPPED

    set_stop_source(lambda: is_closing(worker) or is_cancelled())
    try:
        reply = perform_packed(job, task)
    finally:
        set_stop_source(None)
    if is_closing(worker):
        raise distributed.Reschedule
    return reply


def is_closing(worker):
    """Return whether a worker ends."""
    import distributed

    status = distributed.Status
    return worker.status not in (status.init, status.running, status.paused)
