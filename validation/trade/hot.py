"""Trade at equal error: what each method costs for the error that is left in the particles.

At an equal tolerance the methods leave errors that differ by more than ten times, so that speeds at
equal tolerance compare different answers. One step of the twisted bar with a stiff middle is solved
by each method to a ladder of tolerances, and against a solution at a far smaller one.
"""

from itertools import pairwise
from math import exp, log

import numpy as np

from ..hot.one_step import after, difference, solved
from ..hot.stiffness import METHODS, bar
from ..registry import experiment
from ..verification.scenes import with_

EXACT = 1e-13           # tolerance of the reference
AGREE = 1e-6            # how near the references of two methods must be
POINT = ("method", "eps", "cpu", "error", "cells", "iterations", "inner", "converged", "gap")
LEVELS = (1e-1, 1e-2, 1e-3, 1e-4)       # errors at which times are read off


@experiment("trade.hot.bar", title="HOT at equal error: one step of the twisted bar",
            profiles=("quick", "standard"), budget={"quick": 20, "standard": 900})
def equal_error(run):
    """Ladder of tolerances, times at equal error, and errors at equal tolerance."""
    dx, steps = run.choose(quick=(0.03, 3), standard=(0.02, 6))
    moduli = run.choose(quick=(1e9,), standard=(1e5, 1e7, 1e9))
    ladder = run.choose(quick=(1e-5, 1e-7, 1e-9), standard=tuple(10.0**-k for k in range(3, 12)))
    repeats = run.choose(quick=1, standard=3)
    rows = []
    for E in run.progress(moduli, "moduli"):
        scene = with_(bar(dx, E, "pn-pcg", steps, eps=1e-9), every=1)
        rows += one_stiffness(run, after(scene, steps), E, (ladder, repeats))
    run.table("points", ("E", *POINT), rows)


def one_stiffness(run, step, E, plan):
    """Rows of the table for one modulus, by a plan (tolerances, repeats); records what they say."""
    ladder, repeats = plan
    exact = solved(step, "pn-pcg", eps=EXACT)
    check = solved(step, "pn-mgpcg", eps=EXACT)
    rms, _ = difference(step, check.dv, exact.dv)
    particles = sum(len(body.id) for body in step.bodies)
    scale = f"{particles} particles, {len(exact.dv)} nodes, middle {E:.0e} Pa"
    name = f"trade.hot.bar.E{E:.0e}".replace("+0", "").replace("+", "")
    run.record(f"{name}.references", rms, unit="1", comparator="<=", bound=AGREE, scale=scale,
               note="difference of two references of different methods, relative to the increment")
    rows = [(E, *point(step, exact, (method, eps), repeats))
            for eps in ladder for method in METHODS]
    record_equal_eps(run, name, rows, scale)
    record_equal_error(run, name, rows, scale)
    return rows


def point(step, exact, way, repeats, **caps):
    """method, eps, CPU seconds (median), error, cells, iterations, inner, converged, gap: what is
    left of the energy's fall, against the exact `Solution`; the caps are options.
    """
    method, eps = way
    solutions = [solved(step, method, eps=eps, **caps) for _ in range(repeats)]
    cpu = float(np.median([sum(s.report.seconds.values()) for s in solutions]))
    found, report = solutions[0], solutions[0].report
    system = step.stepper.system(step.pose)
    gap = (found.E - exact.E) / (system.energy(system.start) - exact.E)
    return (method, eps, cpu, *difference(step, found.dv, exact.dv), report.iterations,
            report.inner, report.converged, gap)


def record_equal_eps(run, name, rows, scale):
    """Errors that the paper's tolerance leaves."""
    for _, method, eps, cpu, error, cells, *_ in rows:
        if eps == 1e-7:
            run.record(f"{name}.{method}.error", error, unit="1", comparator="info", scale=scale,
                       note=f"at eps = 1e-7, in {cpu:.3f} CPU seconds; relative error of the "
                       f"particles' velocity increment; displacement off by {cells:.1e} cells")


def record_equal_error(run, name, rows, scale):
    """Times for equal errors, over HOT's."""
    for level in LEVELS:
        times = times_for(rows, level)
        for method, seconds in times.items():
            if seconds is not None and times["hot"] is not None:
                run.record(f"{name}.{method}.time-{level:.0e}".replace("e-0", "e-"),
                           seconds / times["hot"], unit="1", comparator="info", scale=scale,
                           note=f"CPU time for an error of {level:g} over HOT's "
                           f"{times['hot']:.3f} s, between points on a logarithmic line")


def times_for(rows, level):
    """{method: CPU seconds at which its error falls to a level, or None} of rows (.., *`POINT`)."""
    return {m: time_for([r[1:5] for r in rows if r[1] == m], level) for m in METHODS}


def time_for(points, level):
    """CPU seconds at which the error of points (method, eps, cpu, error) falls to a level: those of
    the first if it is below already, None if none is.
    """
    curve = [(cpu, error) for _, _, cpu, error in points]
    if curve and curve[0][1] <= level:
        return curve[0][0]
    for (c0, e0), (c1, e1) in pairwise(curve):
        if e1 <= level < e0:
            share = log(e0 / level) / log(e0 / e1)
            return exp((1.0 - share) * log(c0) + share * log(c1))
    return None
