"""Measure what a step costs besides its particles, and how it scales with threads.

The fixed cost is the time of a step of no particles, by a line through the times of small blocks.
The parallel share f of a phase follows from Amdahl's law and its times on one and on two threads,
T_2 = T_1 (1 - f/2): on n threads it takes T_1 (1 - f + f/n). Where a computer has more cores, steps
are timed on them.
"""

import time

import numpy as np

from mpm_ref.core import jit
from mpm_ref.core.grid import update
from mpm_ref.explicit import damp, deform_body, gather, scatter

from .features import Run, Variant
from .problem import block

SMALL = (4, 6, 8, 11, 14, 17)       # cells per axis of the blocks
LARGE = 23
FORMS = {"serial": 10**9, "threads": 0}     # number of items below which loops are serial
THREADS = 16        # for which Amdahl's law is evaluated
MLS = Variant("MLS, quadratic, fixed corotated")


def sizes(repeats):
    """Return a row per block and form of the loops: median wall and CPU us per step."""
    rows, before = [], jit.few_items
    jit.set_threads(2)
    for cells in SMALL:
        run = Run(MLS, block(cells))
        particles = len(run.bodies[0].id)
        steps = max(5, 100_000 // particles)
        found = {form: [] for form in FORMS}
        for _ in range(repeats + 1):                # the first round compiles
            for form, jit.few_items in FORMS.items():
                found[form].append(per_step(run, steps))
        for form, times in found.items():
            wall, cpu = np.median(times[1:], axis=0)
            rows.append({"particles": particles, "form": form, "wall_us": wall, "cpu_us": cpu})
    jit.few_items = before
    return rows + [fixed_cost(rows, form) for form in FORMS]


def per_step(run, steps):
    """Return wall and CPU us per step."""
    wall, cpu = time.perf_counter(), time.process_time()
    for _ in range(steps):
        run.step()
    scale = 1e6 / steps
    return (time.perf_counter() - wall) * scale, (time.process_time() - cpu) * scale


def fixed_cost(rows, form):
    """Return the row of a step of no particles, by lines through those of a form."""
    of_form = [row for row in rows if row["form"] == form]
    n = [row["particles"] for row in of_form]
    fits = {key: np.polyfit(n, [row[key] for row in of_form], 1, w=1.0 / np.array(n))[1]
            for key in ("wall_us", "cpu_us")}
    return {"particles": 0, "form": form, **{key: float(value) for key, value in fits.items()}}


def shares(repeats):
    """Return a row per phase of a step of 97 336 particles: ns per particle on one and on two
    threads, the parallel share and the speed-up on `THREADS` threads that it allows.
    """
    run, found = Run(MLS, block(LARGE)), {1: [], 2: []}
    for _ in range(repeats + 1):
        for threads, times in found.items():
            jit.set_threads(threads)
            run.step()                          # wakes the threads
            times.append(phases(run))
    scale = 1e9 / len(run.bodies[0].id)
    one, two = (scale * np.median(times[1:], axis=0) for times in found.values())
    names = ("order and p2g", "grid update", "g2p", "deform", "step")
    return [phase_row(*row) for row in zip(names, (*one, one.sum()), (*two, two.sum()))]


def by_threads(cells, numbers, repeats):
    """Return a row for each number of threads: median wall and CPU ns per particle-step of a block
    with so many cells along an axis, and the speed-up over the first number.
    """
    run, found = Run(MLS, block(cells)), {n: [] for n in numbers}
    particles = len(run.bodies[0].id)
    steps = max(1, 300_000 // particles)
    for _ in range(repeats + 1):
        for n, times in found.items():
            jit.set_threads(n)
            run.step()                          # wakes the threads
            times.append(per_step(run, steps))
    scale = 1e3 / particles
    medians = {n: scale * np.median(times[1:], axis=0) for n, times in found.items()}
    first = medians[numbers[0]][0]
    return [{"particles": particles, "threads": n, "wall_ns": float(wall), "cpu_ns": float(cpu),
             "speedup": float(first / wall)} for n, (wall, cpu) in medians.items()]


def phases(run):
    """Return the wall seconds of the phases of one step."""
    stepper, body, dt = run.stepper, run.bodies[0], run.dt
    marks = [time.perf_counter()]
    grid = scatter(run.bodies, stepper.storage, stepper.scheme, dt)
    marks.append(time.perf_counter())
    update(grid, stepper.gravity, dt)
    marks.append(time.perf_counter())
    gather(body, grid, stepper.scheme, dt)
    marks.append(time.perf_counter())
    deform_body(body, dt)
    damp(body, stepper.scheme)
    marks.append(time.perf_counter())
    return np.diff(marks)


def phase_row(name, one, two):
    """Return the row of a phase from its ns per particle on one and on two threads."""
    share = float(np.clip(2.0 * (1.0 - two / one), 0.0, 1.0))
    return {"phase": name, "one_thread_ns": float(one), "two_threads_ns": float(two),
            "parallel_share": share,
            f"speedup_{THREADS}": 1.0 / (1.0 - share + share / THREADS)}
