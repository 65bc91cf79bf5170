"""A dask scheduler and its workers in processes of their own, as on several machines."""

import os
import signal
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PATHS = os.pathsep.join([str(ROOT), str(ROOT / "tests" / "support")])


def environment(**variables):
    """The variables of a process that imports this source and these tests' support."""
    return os.environ | {"PYTHONPATH": PATHS} | variables


class DaskProcesses:
    """The address and the process of a scheduler, and the processes of its workers."""

    def __init__(self, folder):
        self.folder, self.workers = folder, []
        file = folder / "scheduler.json"
        self.scheduler = self.start("scheduler", "--host", "127.0.0.1", "--port", "0",
                                    "--no-dashboard", "--scheduler-file", file)
        self.address = read_address(file)

    def start(self, command, *options, **variables):
        """Return the process of a command of dask's."""
        with open(self.folder / f"{command}.log", "ab") as log:
            return subprocess.Popen(
                [sys.executable, "-m", "distributed.cli.dask_" + command, *options],
                env=environment(**variables), stdout=log, stderr=log, cwd=self.folder)

    def start_worker(self, *options, **variables):
        """Start a worker with one thread, unless the options say otherwise, and no nanny."""
        self.workers.append(self.start(
            "worker", self.address, "--no-nanny", "--no-dashboard", "--local-directory",
            self.folder, *(options or ("--nthreads", "1")), **variables))
        return self.workers[-1]

    def end(self):
        """Kill all."""
        for process in (self.scheduler, *self.workers):
            process.send_signal(signal.SIGKILL)
            process.wait()


def read_address(file, seconds=60.0):
    """Return the address in a scheduler's file, once it is there."""
    latest = time.monotonic() + seconds
    while not file.exists():
        assert time.monotonic() < latest, "no scheduler started"
        time.sleep(0.05)
    time.sleep(0.1)
    return file.read_text().split('"address": "')[1].split('"')[0]


@contextmanager
def dask_processes(folder, workers):
    """A scheduler with so many workers."""
    processes = DaskProcesses(folder)
    try:
        for _ in range(workers):
            processes.start_worker()
        yield processes
    finally:
        processes.end()
