"""Simulate how long many tasks take on 1 to 1000 workers of one dask scheduler.

The scheduler serves one task after the other, which costs the CPU time that is measured here. Task
durations are measured too: CPU seconds of the recorded experiments, and of full-order runs of a
small study. Networks, shared disks and the start of workers are left out.
"""

import heapq
import json
from pathlib import Path
from tempfile import TemporaryDirectory
from time import process_time

import numpy as np

from mpm_ref.cli.catalogue import bundled_scenes
from mpm_ref.cli.study_kinds import find_reduced_study
from mpm_ref.executor import open_executor
from mpm_ref.rom.study.generate import file_of, generate_run, one_thread
from mpm_ref.rom.study.study import load

WORKERS = (1, 2, 4, 8, 16, 32, 64, 128, 256, 512, 1000)
RESULTS = Path(__file__).parents[1] / "results"
STUDY, MANY = "gravity_small", 10_000       # the study, and runs of it to simulate
TASKS = 2_000                               # of nothing, to measure the scheduler


def wall_time(durations, workers, overhead):
    """Return when the last of some tasks ends [s].

    The scheduler hands out tasks in their order to workers that are idle, and needs `overhead`
    seconds for each one, one after the other.
    """
    idle, scheduler = [0.0] * workers, 0.0      # when each worker, and the scheduler, is idle next
    for duration in durations:
        scheduler = max(scheduler, heapq.heappop(idle)) + overhead
        heapq.heappush(idle, scheduler + duration)
    return max(idle)


def nothing(_):
    """Return None at once."""


def scheduling_seconds(tasks=TASKS):
    """Return the CPU seconds of client and scheduler, which share this process, for each task."""
    with open_executor("local:2") as executor:
        list(executor.run(nothing, range(100)))
        start = process_time()
        list(executor.run(nothing, range(tasks)))
        return (process_time() - start) / tasks


def experiment_seconds(folder=RESULTS / "standard"):
    """Return the CPU seconds of the recorded experiments, the longest first."""
    files = sorted(folder.glob("*.json"))
    return sorted((json.loads(file.read_text())[0]["cpu_seconds"] for file in files), reverse=True)


def run_seconds(name=STUDY):
    """Return the CPU seconds of each full-order run of a study; kernels are compiled before."""
    study, seconds = load(find_reduced_study(name), bundled_scenes()), []
    with TemporaryDirectory() as folder, one_thread():
        generate_run(study, folder, 0)
        file_of(folder, 0).unlink()
        for file in Path(folder).iterdir():
            file.unlink()
        for k in range(len(study.mu)):
            start = process_time()
            generate_run(study, folder, k)
            seconds.append(process_time() - start)
    return seconds


def simulated_rows(workload, durations, overhead):
    """Return a row for each number of workers: wall time, and efficiency beside one free worker."""
    busy = sum(durations)
    rows = []
    for workers in WORKERS:
        wall = wall_time(durations, workers, overhead)
        rows.append({"workload": workload, "tasks": len(durations), "task_cpu_s": busy,
                     "longest_s": max(durations), "scheduling_s": overhead, "workers": workers,
                     "wall_s": wall, "efficiency": busy / (workers * wall)})
    return rows


def worker_rows():
    """Return the rows of all workloads."""
    overhead = scheduling_seconds()
    measured = run_seconds()
    many = np.random.default_rng(0).choice(measured, MANY).tolist()
    return [*simulated_rows("standard experiments", experiment_seconds(), overhead),
            *simulated_rows(f"{MANY} runs of {STUDY}", many, overhead)]
