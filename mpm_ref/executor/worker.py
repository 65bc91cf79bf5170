"""Start a worker process, exchange tasks with it through a pipe of its own, and end it."""

import multiprocessing
import os
import signal
import threading
import time
from contextlib import contextmanager, suppress
from multiprocessing import resource_tracker
from multiprocessing.connection import wait

from .tasks import perform_packed, set_stop_source

READY = b"ready"
GRACE = 30.0        # [s] that a task has to stop, and to end after SIGTERM, before it is killed
THREADS = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
CONTEXT = multiprocessing.get_context("spawn")      # a fork of a process with threads may hang


class WorkerProcess:
    """A worker process, the pipe to it, and the index of the task that it performs or None.

    stop: a shared byte, which asks its task to stop unless it is 0.
    """

    def __init__(self, stop):
        self.connection, other_end = CONTEXT.Pipe()
        self.process = CONTEXT.Process(target=serve, args=(other_end, stop))
        with blocked_interrupts():
            self.process.start()
        other_end.close()
        self.handles = (self.connection, self.process.sentinel)
        self.is_ready, self.index = False, None

    @property
    def is_idle(self):
        """Return whether the process waits for a task."""
        return self.is_ready and self.index is None

    def send(self, index, job, task):
        """Send a task. The death of the process is noticed later, by `receive`."""
        self.index = index
        with suppress(OSError):
            self.connection.send_bytes(job)
            self.connection.send_bytes(task)

    def receive(self):
        """Return the bytes that the process sent, or None if it died."""
        with suppress(EOFError, OSError):
            if self.connection.poll():
                return self.connection.recv_bytes()
        return None

    def end_text(self):
        """Wait for the end of the process, and return the cause in words."""
        self.connection.close()
        self.process.join()
        code = self.process.exitcode
        if code < 0:
            return f"was killed ({signal.Signals(-code).name})"
        return f"ended with exit code {code}"


def shared_stop():
    """Return the shared byte 0; it has no lock, which a killed process might never release."""
    return CONTEXT.RawValue("b", 0)


def end_all(workers):
    """End worker processes whose tasks were asked to stop: after GRACE by force."""
    for worker in workers:
        worker.connection.close()
    try:
        for act in (None, "terminate", "kill"):
            _join(workers, act)
    except BaseException:           # the second Ctrl-C
        _join(workers, "kill")
        raise


def _join(workers, act):
    """Call a method of the processes that are alive, and wait for all at most GRACE."""
    latest = time.monotonic() + GRACE
    for worker in workers:
        if act is not None and worker.process.is_alive():
            getattr(worker.process, act)()
    for worker in workers:
        worker.process.join(max(latest - time.monotonic(), 0.0))


@contextmanager
def blocked_interrupts():
    """Keep processes that start in this block from receiving Ctrl-C before they are set up."""
    resource_tracker.ensure_running()       # which unblocks them
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def serve(connection, stop):
    """Perform tasks from a connection until its other end closes, in a process of its own."""
    leave_terminal()
    os.environ.update(THREADS)      # libraries that are loaded later read them
    set_stop_source(lambda: stop.value)
    threading.Thread(target=end_with_parent, daemon=True).start()
    with suppress(EOFError, OSError):       # the parent closed the pipe
        connection.send_bytes(READY)
        while True:
            job, task = connection.recv_bytes(), connection.recv_bytes()
            connection.send_bytes(perform_packed(job, task))


def leave_terminal():
    """Let Ctrl-C of the terminal go to the parent alone, also one that came meanwhile."""
    os.setpgrp()
    if threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})


def end_with_parent():
    """End this process when its parent ended: files are complete at any moment."""
    wait([multiprocessing.parent_process().sentinel])
    os._exit(1)
