"""Full-order runs of a study on a dask cluster, whose workers write into a folder of all machines.

As with `generate`, finished runs are skipped, and interrupted ones resume from their checkpoints.
"""

import threading
from functools import partial

from ...executor import open_executor, stop_asked
from .generate import NOT_WRITTEN, STOP_WATCH, GeneratedRun, generate_run


def generate_on(scheduler, study, folder):
    """Make all runs of a study on a cluster and yield a `GeneratedRun` of each, as they end.

    scheduler: see `open_executor`. After the first that does not end well no other begins, and
    those under way stop. Raises BadScheduler and SchedulerLost.
    """
    make_run = partial(generate_run, study, folder.resolve())
    with open_executor(scheduler, setup=watch_executor) as executor:
        for outcome in executor.run(make_run, range(len(study.mu))):
            done = outcome.value
            if outcome.error is not None:
                done = GeneratedRun(outcome.index, NOT_WRITTEN,
                                    f"run {outcome.index}: {outcome.error}")
            yield done
            if not done.has_data:
                return


class ExecutorStop:
    """The stop that an executor asks of its tasks, as the event that a run watches."""

    def is_set(self):
        """Return whether a stop was asked for. Raises KeyboardInterrupt in a thread.

        Only a main thread may turn a signal into a checkpoint. Elsewhere the run ends at once, and
        resumes from its last checkpoint, which is a minute old at most.
        """
        if stop_asked() and threading.current_thread() is not threading.main_thread():
            raise KeyboardInterrupt
        return stop_asked()


def watch_executor():
    """Let the runs of this process end when their executor asks for it."""
    STOP_WATCH.stop = ExecutorStop()
