"""Trade at equal error: what each method costs for the error that is left in the particles.

At an equal tolerance the methods leave errors that differ by more than ten times, so that speeds at
equal tolerance compare different answers. One step of the twisted bar with a stiff middle is solved
by each method to a ladder of tolerances, and against a solution at a far smaller one.
"""

from itertools import pairwise
from math import exp, log
from typing import NamedTuple

import numpy as np

from ..common.registry import experiment
from ..hot.one_step import particle_errors, solve_step, step_after
from ..hot.stiffness import METHODS, bar

EXACT = 1e-13           # tolerance of the reference
AGREE = 1e-6            # how near the references of two methods must be
LEVELS = (1e-1, 1e-2, 1e-3, 1e-4)       # errors at which times are read off
PAPER = 1e-7            # tolerance of the paper


class SolvePoint(NamedTuple):
    """One solve of a step: what it took, and what it left in the particles."""

    method: str
    eps: float          # its tolerance
    cpu: float          # [s]
    error: float        # of the velocity, root mean square, over that of the increment
    cells: float        # of the displacement, largest of a particle [dx]
    iterations: int
    inner: int          # CG iterations on the finest level
    converged: bool
    gap: float          # left of the energy's fall, over the fall
    error_max: float    # of the velocity, largest of a particle, over the rms of the increment
    cells_rms: float    # of the displacement, root mean square [dx]


POINT_FIELDS = SolvePoint._fields


@experiment("trade.hot.bar", title="HOT at equal error: one step of the twisted bar",
            profiles=("quick", "standard"), budget={"quick": 10, "standard": 900})
def equal_error(run):
    """Ladder of tolerances, times at equal error, and errors at equal tolerance."""
    dx, steps = run.choose(quick=(0.03, 3), standard=(0.02, 6))
    moduli = run.choose(quick=(1e9,), standard=(1e5, 1e7, 1e9))
    ladder = run.choose(quick=(1e-5, 1e-7, 1e-9), standard=tuple(10.0**-k for k in range(3, 13)))
    repeats = run.choose(quick=1, standard=3)
    rows = []
    for E in run.progress(moduli, "moduli"):
        scene = bar(dx, E, "pn-pcg", steps, eps=1e-9)
        found = points_for_stiffness(run, step_after(scene, steps), E, (ladder, repeats))
        rows += [(E, *p) for p in found]
    run.table("points", ("E", *POINT_FIELDS), rows)


def points_for_stiffness(run, step, E, plan):
    """`SolvePoint`s for one modulus, by a plan (tolerances, repeats); records what they say."""
    ladder, repeats = plan
    exact = solve_step(step, "pn-pcg", eps=EXACT)
    check = solve_step(step, "pn-mgpcg", eps=EXACT)
    least = particle_errors(step, check.dv, exact.dv)
    scale = f"{step.particles} particles, {len(exact.dv)} nodes, middle {E:.0e} Pa"
    name = f"trade.hot.bar.E{E:.0e}".replace("+0", "").replace("+", "")
    run.record(f"{name}.references", least.velocity, unit="1", comparator="<=", bound=AGREE,
               scale=scale, note="difference of two references of different methods, relative to "
               "the increment")
    points = [measured_point(step, exact, (method, eps), repeats)
              for eps in ladder for method in METHODS]
    record_equal_eps(run, name, points, scale)
    record_equal_error(run, name, bounded_below(points, least), scale)
    return points


def measured_point(step, exact, rule, repeats, **changes):
    """`SolvePoint` of a rule (method, eps) beside the exact `Solution`, of so many equal solves the
    median time; changes: further options.
    """
    method, eps = rule
    solutions = [solve_step(step, method, eps=eps, **changes) for _ in range(repeats)]
    cpu = float(np.median([sum(s.report.seconds.values()) for s in solutions]))
    found, report = solutions[0], solutions[0].report
    off = particle_errors(step, found.dv, exact.dv)
    system = step.stepper.system(step.pose)
    gap = (found.E - exact.E) / (system.energy(system.start) - exact.E)
    return SolvePoint(method, eps, cpu, off.velocity, off.cells_max, report.iterations,
                 report.cg_iterations,
                 report.converged, gap, off.velocity_max, off.cells)


def bounded_below(points, least):
    """`SolvePoint`s with no error below the reference's own `Errors`: a method that made the
    reference would agree with it to the bit.
    """
    return [p._replace(error=max(p.error, least.velocity),
                       error_max=max(p.error_max, least.velocity_max),
                       cells=max(p.cells, least.cells_max),
                       cells_rms=max(p.cells_rms, least.cells)) for p in points]


def record_equal_eps(run, name, points, scale):
    """Errors that the paper's tolerance leaves."""
    for p in points:
        if p.eps == PAPER:
            run.record(f"{name}.{p.method}.error", p.error, unit="1", comparator="info",
                       scale=scale, note=f"at eps = {PAPER:g}, in {p.cpu:.3f} CPU seconds; "
                       "relative error of the particles' velocity increment, rms; at most "
                       f"{p.error_max:.1e}; displacement off by {p.cells_rms:.1e} cells, at most "
                       f"{p.cells:.1e}; {p.gap:.1e} of the energy's fall are left")


def record_equal_error(run, name, points, scale):
    """Times for equal errors, over HOT's."""
    for level in LEVELS:
        times = times_for(points, METHODS, level)
        for method, seconds in times.items():
            if seconds is not None and times["hot"] is not None:
                run.record(f"{name}.{method}.time-{level:.0e}".replace("e-0", "e-"),
                           seconds / times["hot"], unit="1", comparator="info", scale=scale,
                           note=f"CPU time for an error of {level:g} over HOT's "
                           f"{times['hot']:.3f} s, between points on a logarithmic line")


def times_for(points, methods, level, measure="error"):
    """{method: CPU seconds at which a measure of its `SolvePoint`s falls to a level, or None},
    between solves that did something: one that takes no time is no end of a logarithmic line.
    """
    curves = {m: [(m, p.eps, p.cpu, getattr(p, measure)) for p in points
                  if p.method == m and p.iterations > 0] for m in methods}
    return {m: time_for(curve, level) for m, curve in curves.items()}


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
