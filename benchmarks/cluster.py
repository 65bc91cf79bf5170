"""Time a sweep of one scene on 1, 2, 4, ... workers, and compare the results bit by bit.

All numbers of workers make the same runs: local processes and a Dask cluster of local processes,
which load the kernels before the clock starts.
"""

import hashlib
import os
from time import perf_counter

import msgspec
import numpy as np

from mpm_ref import scene
from mpm_ref.cli.catalogue import find_scene
from mpm_ref.executor import open_executor
from mpm_ref.scene.validate import validate_scene
from mpm_ref.sweep.observation import ObservedRun, observe
from mpm_ref.sweep.probes import choose_probes
from mpm_ref.sweep.setting import in_seconds, scene_at, setting

SCENE = "colliding_disks"
CFL = np.linspace(0.3, 0.9, 64)     # a run each
DX = 0.25                           # factor of the scene's spacing
TIMES = 9


def sweep_tasks():
    """Return the `ObservedRun`s of the sweep."""
    given = validate_scene(in_seconds(scene.load(find_scene(SCENE))))
    probes = tuple((p.body, p.X) for p in choose_probes(scene.build(given).bodies))
    times = tuple(np.linspace(0.0, given.end, TIMES).tolist())
    variants = [scene_at(given, setting(dx=DX, cfl=float(cfl))) for cfl in CFL]
    return [ObservedRun(msgspec.json.encode(one).decode(), scene.digest(one), ("positions",),
                        times, probes) for one in variants]


def timed_sweep(tasks, scheduler, workers):
    """Return (wall time [s], CPU time of all steps [s], hash of all values) of the tasks."""
    with open_executor(scheduler, workers) as executor:
        list(executor.run(observe, tasks[:1] * (2 * workers)))
        start = perf_counter()
        outcomes = sorted(executor.run(observe, tasks), key=lambda outcome: outcome.index)
        wall = perf_counter() - start
    digest = hashlib.sha256()
    for outcome in outcomes:
        if outcome.error is not None:
            raise RuntimeError(outcome.error)
        digest.update(outcome.value.values["positions"].tobytes())
    return wall, sum(outcome.value.cost.cpu for outcome in outcomes), digest.hexdigest()


def measured_rows():
    """Return a row for each executor and number of workers, up to the number of cores."""
    tasks, cores, rows = sweep_tasks(), len(os.sched_getaffinity(0)), []
    for workers in (n for n in (1, 2, 4, 8, 16, 32, 64) if n <= cores):
        for name, scheduler in (("processes", None), ("dask", f"local:{workers}")):
            wall, cpu, digest = timed_sweep(tasks, scheduler, workers)
            rows.append({"executor": name, "workers": workers, "tasks": len(tasks), "wall_s": wall,
                         "task_cpu_s": cpu, "values": digest[:16]})
    for row in rows:
        first = next(one for one in rows if one["executor"] == row["executor"])
        row["speed_up"] = first["wall_s"] / row["wall_s"]
        row["same_bits"] = row["values"] == rows[0]["values"]
    return rows
