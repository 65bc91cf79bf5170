"""Full-order runs of a study into a folder, a results file for each, on several processes.

What is there is not made again: a finished run is left as it is, one that was cut off goes on from
its last checkpoint.
"""

import multiprocessing
import os
import signal
import threading
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing.connection import wait
from pathlib import Path
from typing import NamedTuple

import numba
import threadpoolctl

from ...core.grid import OutOfRange
from ...monitor import Unstable
from ...scene import build, digest
from ...store.atomic import NotWritten
from ...store.results import BadResults, Results
from ...store.running import FINISHED, Options, Watch, checkpoint_of, run
from ...store.writer import StoredFields
from ...timestep import TooLarge

SKIPPED, INTERRUPTED = "skipped", "interrupted"
UNSTABLE, NOT_WRITTEN, REFUSED = "unstable", "not written", "refused"


class GeneratedRun(NamedTuple):
    """The end of a full-order run of a study."""

    number: int
    why: str                    # FINISHED, or one of the words above
    message: str = ""
    continued: bool = False     # from a checkpoint

    @property
    def has_data(self):
        """Its data are there."""
        return self.why in (FINISHED, SKIPPED)


def file_of(folder, k):
    """Return the results file of run number k."""
    return Path(folder) / f"case-{k:03d}.h5"


def generate(study, folder, workers=1):
    """Make all runs of a study and yield a `GeneratedRun` of each, as they end.

    After the first that does not end well no other begins. Those under way then, or at Ctrl-C, end
    after the step being made, with a checkpoint. Each process uses one thread.
    """
    numbers = range(len(study.mu))
    if workers > 1:
        yield from _in_processes(study, folder, min(workers, len(numbers)))
        return
    with one_thread():
        for k in numbers:
            done = generate_run(study, folder, k)
            yield done
            if not done.has_data:
                return


def _in_processes(study, folder, workers):
    """Yield as `generate`, with several new processes: a fork of one with threads may hang."""
    context = multiprocessing.get_context("spawn")
    stop = context.Event()
    with ProcessPoolExecutor(workers, context, _begin_worker, (stop,)) as pool:
        with _ignore_interrupts():
            futures = [pool.submit(generate_run, study, folder, k) for k in range(len(study.mu))]
        try:
            for future in as_completed(futures):
                yield (done := future.result())
                if not done.has_data:
                    return
        except BrokenProcessPool:
            yield GeneratedRun(
                -1, NOT_WRITTEN, "a process that made runs was killed, for want of memory perhaps; "
                "the same command goes on, with fewer --workers if need be")
        finally:
            stop.set()
            pool.shutdown(wait=True, cancel_futures=True)


@contextmanager
def _ignore_interrupts():
    """Keep processes that are started in this block from receiving Ctrl-C before they have
    begun.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


class _StopWatch(Watch):
    """Ends a run as Ctrl-C would, once `stop` is set: the terminal's own goes to the parent."""

    stop = None         # of a process that only makes runs

    def step(self, state, dt):
        """End the run after a step if a stop was asked for."""
        if self.asked:
            signal.raise_signal(signal.SIGINT)

    @property
    def asked(self):
        """Whether a stop was asked for."""
        return self.stop is not None and self.stop.is_set()


STOP_WATCH = _StopWatch()


def _begin_worker(stop):
    """Set up a worker process: one thread, Ctrl-C by `stop` alone, an end with its parent. As files
    are complete at any moment, a process may end at any.
    """
    def end_with_parent():
        wait([multiprocessing.parent_process().sentinel])
        os._exit(1)

    os.setpgrp()
    STOP_WATCH.stop = stop
    numba.set_num_threads(1)
    threadpoolctl.threadpool_limits(1)
    threading.Thread(target=end_with_parent, daemon=True).start()


def generate_run(study, folder, k):
    """Return the `GeneratedRun` of run number k, which is made if it is not there."""
    path = file_of(folder, k)
    if STOP_WATCH.asked:
        return GeneratedRun(k, INTERRUPTED)
    try:
        scene = study.scene(study.mu[k])
        if is_finished(path, scene):
            return GeneratedRun(k, SKIPPED)
        continued = checkpoint_of(path).exists()
        outcome = run(build(scene), path, run_options(study, k), STOP_WATCH)
    except (Unstable, OutOfRange, TooLarge) as fault:
        return GeneratedRun(k, UNSTABLE, f"run {k} ({parameter_text(study, study.mu[k])}): {fault}")
    except NotWritten as fault:
        return GeneratedRun(k, NOT_WRITTEN, str(fault))
    except (ValueError, OSError) as fault:
        return GeneratedRun(k, REFUSED, str(fault))
    why = FINISHED if outcome.why == FINISHED else INTERRUPTED
    return GeneratedRun(k, why, continued=continued)


def run_options(study, k):
    """Return the `Options` with which run number k is recorded."""
    facts = {}
    if study.model_entry:
        facts = {"parameters": dict(zip(study.names, study.mu[k].tolist(), strict=True))}
    return Options(fields=StoredFields(study.method.stored), resume=True, facts=facts)


def is_finished(path, scene):
    """Return whether a file has all steps of a scene. Raises BadResults for a file that is no
    results file, or of another scene.
    """
    if not path.exists():
        return False
    with Results(path) as results:
        if results.h5.attrs["scene_sha256"] != digest(scene):
            raise BadResults(f"{path} holds a run of another scene or study; name another folder, "
                             "or remove this one's files")
        parts = results.manifest.get("parts")
        return bool(parts) and parts[-1]["why"] == FINISHED


def parameter_text(study, mu):
    """Return parameters in words."""
    return ", ".join(f"{name} = {value:g}" for name, value in
                     zip(study.names, mu, strict=True))


@contextmanager
def one_thread():
    """Limit kernels and BLAS to one thread in this block: runs of a few thousand particles gain
    nothing from more.
    """
    before = numba.get_num_threads()
    numba.set_num_threads(1)
    try:
        with threadpoolctl.threadpool_limits(1):
            yield
    finally:
        numba.set_num_threads(before)
