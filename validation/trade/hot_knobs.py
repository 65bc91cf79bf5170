"""HOT's knobs at equal error: the cost of each, one at a time and together.

One step is solved with each setting to a ladder of tolerances, and times are read off at which its
error falls to given levels. Ratios of times of one run,
settings in turn, so that load bears on all of them.
"""


import numpy as np

from mpm_ref.hot.methods import METHODS, RULES, printed

from ..common.registry import experiment
from ..hot.one_step import difference, solve_step, step_after
from ..hot.stiffness import bar
from ..hot.warm_states import following_steps, warm_state
from .hot import time_for

HOT = METHODS["hot"].cycle
BARS = {"bar 1e6": 1e6, "bar 1e9": 1e9}
KNOBS = {
    "paper": {},
    "levels 2": {"levels": 2},
    "levels 4": {"levels": 4},
    "window 4": {"window": 4},
    "window 20": {"window": 20},
    "sweeps 2": {"cycle": HOT._replace(sweeps=2)},
    "jacobi": {"cycle": HOT._replace(smoother="jacobi")},
    "chebyshev": {"cycle": HOT._replace(smoother="chebyshev")},
    "coarsest to 0.05": {"cycle": HOT._replace(tolerance=0.05)},
    "coarsest direct": {"cycle": HOT._replace(coarsest="direct")},
    "single precision": {"cycle": HOT._replace(precision="single")},
    "quadratic kernel": {"kernel": "quadratic"},
    "rebuild 5": {"rebuild_every": 5},
    "renew shortened": {"rebuild_when": "shortened"},
    "renew stale": {"rebuild_when": "stale"},
    "start gravity": {"start": "gravity"},
    "shorter trials": {"search": RULES._replace(shrink=0.2)},
}
SETTINGS = {name: printed("hot", **knob) for name, knob in KNOBS.items()}
SETTINGS["hot-plus"] = printed("hot-plus")
SHORT = ("paper", "hot-plus")      # of the quick profile
LEVELS = (1e-2, 1e-4)               # errors at which times are compared
EXACT = 1e-12
PAPER = 1e-7
CFL = (0.25, 0.5, 1.0, 2.0)         # of the step that the scene takes
CAPS = {"max_iterations": 500}


@experiment("trade.hot.knobs", title="HOT: levels, window, smoothing, rebuilds at equal error",
            profiles=("quick", "standard"), budget={"quick": 8, "standard": 900})
def knobs(run):
    """Compare the time of every setting with the paper's, on several scenes, and lengths of the
    step.
    """
    names, ladder, tried, repeats = run.choose(
        quick=(("bar 1e9",), (1e-7, 1e-8, 1e-9), SHORT, 1),
        standard=(("bar 1e6", "bar 1e9", "boxes", "faceless"),
                  (1e-6, 1e-7, 1e-8, 1e-9), tuple(SETTINGS), 1))
    rows, lengths = [], []
    for name in run.progress(names, "scenes"):
        step, scale = initial_step(name)
        rows += settings(run, (name, step, scale), tried, (ladder, repeats))
        lengths += times(run, (name, step, scale))
    run.table("points", ("scene", "setting", "eps", "cpu", "error", "cells", "iterations",
                         "converged"), rows)
    run.table("lengths", ("scene", "share", "dt", "cpu", "iterations", "error"), lengths)


def initial_step(name):
    """Return the `ImplicitStep` of a bar or a scene of HOT, and its scale as text."""
    if name in BARS:
        step = step_after(bar(0.03, BARS[name], "pn-mgpcg", 6, eps=1e-9), 6)
    else:
        problem, state = warm_state(name, "quick")
        step = next(following_steps(problem, state, 1))
    return step, f"{step.particles} particles, {len(step.pose.unknowns.m)} nodes, one step"


def reference(step):
    """Return the increment of an `ImplicitStep` that errors are measured from."""
    return solve_step(step, "pn-mgpcg", eps=EXACT, flexible=True, **CAPS).dv


def settings(run, about, tried, plan):
    """Solve one step with each setting, by a plan (tolerances, repeats), and record times over the
    paper's. Returns the rows of the table.
    """
    name, step, _ = about
    ladder, repeats = plan
    exact = reference(step)
    for setting in tried:
        solve_step(step, SETTINGS[setting], max_iterations=2)               # compiles
    rows = {}
    for eps in ladder:
        for setting in tried:
            found = [solve_step(step, SETTINGS[setting], eps=eps, **CAPS) for _ in range(repeats)]
            cpu = float(np.median([sum(f.report.seconds.values()) for f in found]))
            rows.setdefault(setting, []).append(
                (name, setting, eps, cpu, *difference(step, found[0].dv, exact),
                 found[0].report.iterations, found[0].report.converged))
    for level in LEVELS:
        record_level(run, about, rows, level)
    return [row for group in rows.values() for row in group]


def record_level(run, about, rows, level):
    """Record times for one error, over the paper's."""
    name, _, scale = about
    seconds = {s: time_for([row[1:5] for row in group], level) for s, group in rows.items()}
    base = seconds.pop("paper")
    for setting, cpu in seconds.items():
        if base is not None and cpu is not None:
            key = f"trade.hot.knobs.{name}.{setting}.{level:g}".replace(" ", "-")
            run.record(key, cpu / base, comparator="info", scale=scale,
                       note=f"CPU time for an error of {level:g} over the paper's {base:.3f} s")


def times(run, about):
    """Solve steps of other lengths from the same state, to one tolerance. Returns table rows."""
    name, step, scale = about
    found = []
    for share in CFL:
        dt = share * step.dt
        pose = step.stepper.problem(step.bodies, step.t, dt)
        other = step._replace(pose=pose, dt=dt)
        solution, exact = solve_step(other, "hot", **CAPS), reference(other)
        cpu = sum(solution.report.seconds.values())
        error = difference(other, solution.dv, exact)[0]
        found.append((name, share, dt, cpu, solution.report.iterations, error))
    reference_cpu = next(row[3] for row in found if row[1] == 1.0)
    for _, share, _, cpu, iterations, error in found:
        if share != 1.0:
            run.record(f"trade.hot.knobs.{name}.dt-{share:g}".replace(" ", "-"),
                       cpu / share / reference_cpu, comparator="info", scale=scale,
                       note=f"CPU time per simulated time, over that of steps of {step.dt:.2e} s; "
                       f"{iterations} iterations, relative error {error:.1e} at eps = {PAPER:g}")
    return found
