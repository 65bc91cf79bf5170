"""Perform tasks on a dask cluster: new processes of this machine, or workers of many machines.

A dask scheduler and its workers execute the code of whoever can reach them: see
`docs/howto/many-machines.md`. dask is imported only here, and only where it is asked for.
"""

import importlib.util
import logging
import time
import uuid
from contextlib import ExitStack, suppress
from functools import partial
from queue import Empty, SimpleQueue

from .dask_tasks import count_tasks, perform_on_worker, worker_facts
from .tasks import ATTEMPTS, TaskOutcome, pack_job, pack_tasks, sentence, unpack
from .versions import BadScheduler, WorkerMismatch, disagreement, versions
from .worker import GRACE, blocked_interrupts

CONNECT = 15.0      # [s] that a scheduler has to answer at first
FIRST = 60.0        # [s] that the first worker has to connect
CHECK = 10.0        # [s] without an outcome, after which the scheduler is asked for its workers
ANSWER = 60.0       # [s] that it has to answer then
FETCH = 30.0        # [s] for a value to arrive, before others are looked at
CLOSE = 60.0        # [s] that the processes of a local cluster have to end
ALONE = 300.0       # [s] that a run waits for a worker when all have left

LOCAL = {       # options of dask for processes of this machine
    "distributed.scheduler.worker-saturation": 1.0,         # no worker has a task in reserve
    "distributed.deploy.lost-worker-timeout": "1 hour"}     # a killed one starts again, be it late


class SchedulerLost(RuntimeError):
    """A dask scheduler, or all of its workers, left while tasks were to be performed."""


def load_dask():
    """Return the modules (dask, distributed). Raises BadScheduler where they are not installed."""
    try:
        import dask
        import distributed
    except ImportError:
        raise BadScheduler("several machines need dask: pip install 'mpm_ref[sweep]'") from None
    return dask, distributed


def has_dashboard():
    """Return whether what dask's page for browsers needs is installed."""
    return importlib.util.find_spec("bokeh") is not None


def open_local_cluster(count, setup=None):
    """Return a `DaskCluster` of `count` new processes of this machine."""
    dask, distributed = load_dask()
    resources = ExitStack()
    resources.enter_context(dask.config.set(LOCAL))
    with resources, blocked_interrupts():   # also for good in the thread that starts the processes
        cluster = distributed.LocalCluster(
            n_workers=count, threads_per_worker=1, processes=True, memory_limit=None,
            dashboard_address="127.0.0.1:0",
            silence_logs=logging.CRITICAL, scheduler_kwargs={"allowed_failures": ATTEMPTS - 1})
        resources.callback(close_cluster, cluster)
        client = distributed.Client(cluster, set_as_default=False)
        return DaskCluster(client, setup, resources.pop_all())


def close_cluster(cluster):
    """End the processes of a local cluster; a late one ends with this process."""
    with suppress(TimeoutError):
        cluster.close(timeout=CLOSE)


def connect(address, setup=None):
    """Return a `DaskCluster` of the scheduler at an address. Raises BadScheduler for none, for no
    workers, or workers with other software than this process.
    """
    _, distributed = load_dask()
    try:
        client = distributed.Client(address, timeout=CONNECT, set_as_default=False)
    except (OSError, TimeoutError, ValueError) as error:
        raise BadScheduler(f"scheduler {address}: no dask scheduler answers there "
                           f"({sentence(error)}); start one with `dask scheduler`") from None
    cluster = DaskCluster(client, setup)
    try:
        cluster.require_workers()
    except BaseException:
        cluster.close()
        raise
    return cluster


class DaskCluster:
    """An executor of a dask client; its `workers` have one thread each.

    local: the open resources of local processes, which end with it.
    """

    def __init__(self, client, setup=None, local=None):
        self._client, self._setup, self._local = client, setup, local
        self._address, self._alone_since = client.scheduler.address, None
        self._is_lost = False
        logging.getLogger("distributed.client").setLevel(logging.CRITICAL)  # we raise SchedulerLost

    @property
    def workers(self):
        """The number of workers at present."""
        return len(self._client.nthreads())

    @property
    def dashboard(self):
        """The address of the scheduler's page for browsers, or None."""
        if self._local is not None and not has_dashboard():
            return None
        return self._client.dashboard_link or None

    def require_workers(self):
        """Wait for a worker. Raises BadScheduler for none, or one with other software than here."""
        try:
            self._client.wait_for_workers(1, timeout=FIRST)
        except TimeoutError:
            raise BadScheduler(
                f"scheduler {self._address}: no worker connected within {FIRST:g} s; start some "
                f"with `dask worker {self._address} --nthreads 1`") from None
        for worker, facts in self._client.run(worker_facts, on_error="return").items():
            reason = disagreement(worker, facts, versions())
            if reason:
                raise WorkerMismatch(reason)

    def run(self, function, tasks):
        """Yield the `TaskOutcome` of function(task) for each task, as they end.

        The task of a worker that left begins again on another one: ATTEMPTS times in all on this
        machine, else as often as the scheduler is set to. A caller that leaves the loop early asks
        the tasks under way to stop. Raises ValueError for a function or a task that cannot be sent,
        `WorkerMismatch` for a worker that came later with other software, and `SchedulerLost`.
        """
        return self._outcomes(pack_job(function, self._setup), pack_tasks(tasks))

    def _outcomes(self, job, tasks):
        run, ended = f"mpm_ref-{uuid.uuid4().hex}", SimpleQueue()
        futures = {}
        try:
            perform = partial(perform_on_worker, job, versions())
            for future in self._client.map(perform, tasks, pure=False,
                                           key=[(run, k) for k in range(len(tasks))]):
                futures[future.key] = future
                future.add_done_callback(ended.put)
            while futures:
                future = self._next(ended)
                outcome = self._outcome(future)
                if outcome is None:
                    future.add_done_callback(ended.put)
                    continue
                del futures[future.key]
                future.release()
                yield outcome
        finally:
            if futures:
                self._cancel(list(futures.values()), run)

    def _next(self, ended):
        """Return the next future of a queue. Raises `SchedulerLost`."""
        while True:
            try:
                return ended.get(timeout=CHECK)
            except Empty:
                self._require_answer()

    def _require_answer(self):
        """Raise `SchedulerLost` if the scheduler does not answer, or has long had no worker."""
        try:
            workers = self._client.sync(self._client.scheduler.ncores, callback_timeout=ANSWER)
        except (OSError, TimeoutError, AttributeError, RuntimeError):
            raise self._lost("does not answer") from None
        now = time.monotonic()
        self._alone_since = None if workers else self._alone_since or now
        if not workers and now - self._alone_since > ALONE:
            raise self._lost(f"has had no worker for {ALONE:g} s")

    def _outcome(self, future):
        """Return the `TaskOutcome` of a future that ended. Raises `SchedulerLost`.

        Returns None if its value was lost with its worker: the task begins again.
        """
        _, distributed = load_dask()
        _, index = future.key
        if future.status in ("pending", "lost"):
            return None
        try:
            return unpack(index, future.result(timeout=FETCH))
        except WorkerMismatch:
            raise
        except distributed.CancelledError:
            raise self._lost("has gone") from None
        except (OSError, TimeoutError):
            self._require_answer()
            return None
        except distributed.scheduler.KilledWorker:
            return TaskOutcome(index, error="its workers were killed, each time that it was tried, "
                               "for want of memory perhaps: try fewer workers on a machine")
        except Exception as error:
            return TaskOutcome(index, error=sentence(error))

    def _lost(self, reason):
        self._is_lost = True
        return SchedulerLost(f"the dask scheduler at {self._address} {reason}: finished results "
                             "are kept, and the same command goes on with a scheduler that runs")

    def _cancel(self, futures, run):
        """Cancel pending tasks, ask those under way to stop, and wait for them at most GRACE."""
        if self._is_lost or self._client.status != "running":
            return
        latest = time.monotonic() + GRACE
        with suppress(OSError, TimeoutError):
            self._client.cancel(futures)
            while self._count_busy(run) and time.monotonic() < latest:
                time.sleep(0.05)

    def _count_busy(self, run):
        counts = self._client.run(count_tasks, run, on_error="ignore")
        return sum(counts.values())

    def close(self):
        """End the connection, and the processes that were started for it."""
        with suppress(OSError, TimeoutError):
            self._client.close(timeout=ANSWER)
        if self._local is not None:
            self._local.close()
