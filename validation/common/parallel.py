"""Run experiments in parallel: the processes share the cores evenly.

Kernels are compiled by one core whatever the number of threads, so that two experiments at a time
take not much more than half the time of one after the other. Timings are CPU seconds; with
another experiment at work they vary more, and each record has the number of `workers`.
"""

import os
from concurrent.futures import ProcessPoolExecutor, as_completed
from functools import cache
from math import ceil
from multiprocessing import get_context

import numba
import threadpoolctl
from tqdm import tqdm

from mpm_ref.core.jit import set_threads

from .progress import SuiteProgress
from .registry import discover
from .run import attempt

MOST = 80       # experiments that a process may see: compiled kernels stay in its memory


@cache
def experiment_of(experiment_id):
    """Return the experiment of that id."""
    return discover().experiments[experiment_id]


def run_side_by_side(experiments, setting, workers, find=experiment_of):
    """Run experiments like `run.run_all`, `workers` at a time, the longest first.

    Each process calls find(id) for its experiments, since a function that another function made
    cannot be sent to a process.
    """
    longest = sorted(experiments, key=lambda e: -e.seconds(setting.profile))
    pools = ceil(len(longest) / MOST)
    setting = setting._replace(workers=workers)
    failed = []
    with SuiteProgress([e.seconds(setting.profile) for e in experiments]) as progress:
        for k in range(pools):
            failed += run_in_pool(longest[k::pools], setting, find, progress)
    return failed


def run_in_pool(experiments, setting, find, progress):
    """Run experiments in new processes, one for each worker. Return the ids of those that fail."""
    failed, share = [], (setting.workers,)
    with ProcessPoolExecutor(setting.workers, get_context("spawn"), take_share, share) as pool:
        futures = {pool.submit(attempt_in_process, find, e.id, setting): e for e in experiments}
        try:
            for future in as_completed(futures):
                experiment = futures[future]
                summary, raised = result_of(future)
                if raised:
                    progress.say(raised)
                    failed.append(experiment.id)
                progress.ended(experiment.id, experiment.seconds(setting.profile), summary)
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise
    return failed


def attempt_in_process(find, experiment_id, setting):
    """Return the `ExperimentOutcome` of an experiment that runs in this process."""
    return attempt(find(experiment_id), setting, Silent())


def result_of(future):
    """Return (summary, traceback or None) of a future, also of one whose process died."""
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
    """A `SuiteProgress` for a process that has no place on the terminal."""

    def inner(self, iterable, desc):
        """Iterate like `SuiteProgress.inner`, without a bar."""
        items = range(iterable) if isinstance(iterable, int) else iterable
        return tqdm(items, desc=desc, disable=True)
