"""Experiments side by side: as many processes as are asked for share the cores evenly.

Kernels are compiled by one core whatever the number of threads, so that two experiments at a time
take not much more than half the time of one after the other. Timings are CPU seconds; beside
another experiment they are less quiet, and each record's `workers` says so.
"""

import os
from concurrent.futures import ProcessPoolExecutor, as_completed
from functools import cache
from multiprocessing import get_context

import numba
import threadpoolctl
from tqdm import tqdm

from mpm_ref.core.jit import set_threads

from .progress import Progress
from .registry import discover
from .run import attempt


@cache
def known(id):
    """The experiment of that id."""
    return discover().experiments[id]


def run_side_by_side(experiments, setting, workers, find=known):
    """As `run.run_all`, so many at a time, those that take longest first. Each process asks
    find(id) for its experiments, since functions made by functions cannot be sent to it.
    """
    longest = sorted(experiments, key=lambda e: -e.seconds(setting.profile))
    setting = setting._replace(targets=dict(setting.targets), workers=workers)
    failed = []
    with (Progress([e.seconds(setting.profile) for e in experiments]) as progress,
          ProcessPoolExecutor(workers, get_context("spawn"), take_share, (workers,)) as pool):
        coming = {pool.submit(apart, find, e.id, setting): e for e in longest}
        try:
            for future in as_completed(coming):
                experiment = coming[future]
                summary, raised = what_came(future)
                if raised:
                    progress.say(raised)
                    failed.append(experiment.id)
                progress.ended(experiment.id, experiment.seconds(setting.profile), summary)
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise
    return failed


def apart(find, id, setting):
    """`Outcome` of an experiment in this process."""
    return attempt(find(id), setting, Silent())


def what_came(future):
    """(summary, what was raised or None) of a future; that of a process which died says so."""
    try:
        outcome = future.result()
    except Exception as error:
        return "FAILED: its process ended", f"{type(error).__name__}: {error}"
    return outcome.summary, outcome.raised


def take_share(workers):
    """Let this process use its share of the cores."""
    threads = max((os.cpu_count() or 1) // workers, 1)
    set_threads(min(threads, numba.config.NUMBA_NUM_THREADS))
    threadpoolctl.threadpool_limits(threads)


class Silent:
    """Stands for a `Progress` in a process that has no place on the terminal."""

    def inner(self, iterable, desc):
        """As `Progress.inner`, without a bar."""
        items = range(iterable) if isinstance(iterable, int) else iterable
        return tqdm(items, desc=desc, disable=True)
