"""Measure steps of whole runs by HOT as published and by our variants, on the same states in turn.

The public code of HOT was timed for this project on two cores of the kind that ours runs on, on
scenes that are not in its release. Those here have as many particles of as stiff a material, no
more: `public` is for orientation, and only ratios between our own variants are of one run. Times
are CPU seconds from the particles to the accepted increment.
"""

from pathlib import Path
from time import process_time
from typing import NamedTuple

import numpy as np

from mpm_ref.hot.methods import minimise, printed, released
from mpm_ref.scene import build, load
from mpm_ref.simulate import simulate
from validation.common.scenes import with_
from validation.hot.stiffness import bar
from validation.hot.warm_states import following_steps, warm_state

SCENES = Path(__file__).parent / "scenes"
VARIANTS = {                        # the first is what the others are relative to
    "hot": printed("hot"),
    "hot, options of the release": released("hot"),
    "hot-plus": printed("hot-plus"),
    "pn-mgpcg, flexible": printed("pn-mgpcg", flexible=True),
}


class Timed(NamedTuple):
    """Steps of a run that are to be timed."""

    begin: callable             # -> (`Problem`, `State` before the first of them)
    steps: int
    public: float | None        # CPU seconds per step of the public code on a like scene


def started(scene):
    """Return the `Problem` of a scene and its `State` at the first frame."""
    problem = build(with_(scene, unstable="allow"))
    return problem, next(simulate(problem)).state


RUNS = {
    "drop": Timed(lambda: started(load(SCENES / "drop.toml")), 12, 1.43),
    "sphere": Timed(lambda: started(load(SCENES / "sphere.toml")), 5, 3.1),
    "bar": Timed(lambda: started(bar(0.015, 1e9, "hot", 40)), 12, 1.1),
    "metal": Timed(lambda: warm_state("aluminium", "quick"), 8, 0.39),
    "metal-fine": Timed(lambda: warm_state("aluminium", "standard"), 5, None),
    "twist": Timed(lambda: started(bar(0.0228, 1e9, "hot", 40)), 12, None),
}


def run_rows(name):
    """Return a row for every variant: times and iterations of the steps of a run.

    The first step is left out, since kernels are compiled in it.
    """
    run = RUNS[name]
    problem, state = run.begin()
    taken = {variant: [] for variant in VARIANTS}
    for step in following_steps(problem, state, run.steps + 1):
        for variant, options in VARIANTS.items():
            taken[variant].append(timed(step, options))
    where = {"run": name, "particles": step.particles, "nodes": len(step.pose.unknowns.m),
             "steps": run.steps, "public_cpu_s": run.public}
    rows = [where | variant_row(variant, done[1:]) for variant, done in taken.items()]
    return [row | {"cpu_ratio": row["cpu_s"] / rows[0]["cpu_s"]} for row in rows]


def timed(step, options):
    """Solve a step from its particles on and return CPU seconds and report."""
    start = process_time()
    pose = step.stepper.problem(step.bodies, step.t, step.dt)
    system = step.stepper.system(pose, near=first_increment(pose, options))
    report = minimise(system, options).report
    return process_time() - start, report


def first_increment(pose, options):
    """Return the increment (n, d) [m/s] near which options, not those of the scene, let a solve
    start: free fall, or the increment that conditions ask for.
    """
    dv0 = pose.unknowns.dv0
    return np.broadcast_to(pose.gravity_increment, dv0.shape) if options.start == "gravity" else dv0


def variant_row(variant, done):
    """Return the row of a variant from the CPU seconds and report of each step."""
    seconds, reports = zip(*done, strict=True)
    counts = [report.iterations for report in reports]
    return {"variant": variant, "cpu_s": float(np.mean(seconds)), "most_cpu_s": max(seconds),
            "iterations": float(np.mean(counts)), "most_iterations": max(counts),
            "converged": all(report.converged for report in reports)}
