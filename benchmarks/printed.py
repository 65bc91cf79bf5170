"""Measure implicit steps of a scene at the size that the paper prints, on some numbers of threads.

Each measurement has a process of its own, whose peak memory is that of the run. All make the same
steps, bit for bit, as long as the first one lasts.
"""

import resource
import time
from math import inf
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import threadpoolctl

from mpm_ref.core.jit import set_threads
from mpm_ref.scene import build, load
from mpm_ref.simulate import advance, ended, frame_is_due, show, start
from validation.common.scenes import with_
from validation.hot.sizes import sized


def costs(names, threads, seconds, method):
    """Return a row for each scene and number of threads: the steps that the first of them makes in
    so many seconds of wall time. names: of scene files, or of scenes of `validation.hot.sizes`.
    """
    rows = []
    for name in names:
        steps, limit = 10**9, seconds
        for n in threads:
            row = in_own_process(name, n, limit, method, steps)
            steps, limit = row["steps"], inf
            rows.append(row)
    return rows


def in_own_process(*arguments):
    """Return the row of `cost` from a process of its own."""
    with get_context("spawn").Pool(1) as pool:
        return pool.apply(cost, arguments)


def cost(name, threads, seconds, method, most):
    """Return the row of the first steps of a scene: at most so many, in so many seconds."""
    set_threads(threads)
    with threadpoolctl.threadpool_limits(threads):
        short = Path(name).stem.removeprefix("hot_")
        step_costs(first_state(sized(f"hot_{short}", "quick"), method), 600, 3)       # compiles
        begun = time.perf_counter()
        run = first_state(printed_scene(name), method)
        built = time.perf_counter() - begun
        steps = step_costs(run, seconds, most)
    iterations, wall, cpu = np.transpose(steps)
    problem, _, state = run
    return {"scene": Path(name).stem, "method": method, "threads": threads,
            "particles": sum(len(body.id) for body in problem.bodies), "dx": problem.dx,
            "steps": len(steps), "t": state.t, "end": problem.clock.end, "start_s": built,
            "iterations": iterations.mean(), "most_iterations": iterations.max(),
            "wall_s": wall.mean(), "cpu_s": cpu.mean(), "slowest_wall_s": wall.max(),
            "peak_bytes": 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss}


def printed_scene(name):
    """Return the scene in a file, or that of a name at the printed size."""
    return load(name) if Path(name).is_file() else sized(f"hot_{name}", "paper")


def first_state(scene, method):
    """Return (problem, stepper, first state) of a scene under a method."""
    problem = build(with_(scene, integrator=method, unstable="allow"))
    stepper = problem.stepper()
    state = start(problem, stepper)
    show(state, 0.0)
    return problem, stepper, state


def step_costs(run, seconds, most):
    """Make steps and return (iterations, wall s, CPU s) of each."""
    problem, stepper, state = run
    rows, begun = [], time.perf_counter()
    while (len(rows) < most and not ended(problem.clock, state)
           and time.perf_counter() - begun < seconds):
        wall, cpu = time.perf_counter(), time.process_time()
        dt = advance(problem, stepper, state)
        rows.append((state.solve.iterations, time.perf_counter() - wall,
                     time.process_time() - cpu))
        if frame_is_due(problem.clock, state):
            show(state, dt)
    return rows
