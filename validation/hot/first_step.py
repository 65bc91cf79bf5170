"""Figure 16: the first step of Faceless by every method, ADMM among them.

ADMM's residual is not a measure of its error: where its iterates meet the tolerance, the particles
are further from the solution than those of the others. So its time is compared twice, at the
paper's tolerance and at the error that HOT has there.
"""

from mpm_ref.scene import build

from ..common.registry import experiment
from .iterates import (
    COLUMNS,
    EPS,
    MethodSetup,
    initial_step,
    iterate_errors,
    quickest,
    setups,
    solve_note,
)
from .one_step import difference, solve_step
from .warm_states import scene

EXACT = 1e-13               # tolerance of the reference
FURTHER = 1e-9              # tolerance of methods whose iterates do not depend on it
PATIENCE = 2000             # iterations
DESCENTS = ("hot", "hot-quadratic", "lbfgs-h", "lbfgs-gmg", "admm")
NEWTONS = ("pn-pcg", "pn-pcg-mf", "pn-mgpcg", "pn-gmg-pcg", "sgs-pcg")
PENALTIES = (0.1, 0.3, 3.0)         # of ADMM, besides 1
ADMM, HOT = "admm", "hot"


@experiment("hot.fig16", title="First step of Faceless: residual and error by every method",
            profiles=("quick", "standard"), budget={"quick": 10, "standard": 180})
def first_step(run):
    """Record the residuals of all methods by iterate, and ADMM's time over HOT's."""
    step = initial_step(build(scene("faceless", "quick")))
    for setup in method_setups():
        quickest(step, setup, 1, max_iterations=2)                  # compiles
    if run.profile != "quick":
        step = initial_step(build(scene("faceless", "paper")))
    exact = solve_step(step, "pn-pcg", eps=EXACT)
    scale = (f"{step.particles} particles (the paper: 110 000), "
             f"{len(exact.dv)} nodes, dt = {step.dt:.3g} s")
    check_reference(run, step, exact, scale)
    descents, curves = {}, {}
    for setup in run.progress(method_setups(), "methods"):
        descent = quickest(step, setup, run.choose(quick=3, standard=2))
        descents[setup.name] = descent
        curves[setup.name] = iterate_errors(step, descent, exact.dv)
        record_method(run, descent, curves[setup.name], scale)
    record_slowdown(run, descents, curves, scale)
    record_penalties(run, step, exact.dv, scale)
    run.table("iterates", (*COLUMNS, "error", "cells"),
              [(name, *descent.rows[k], *error) for name, descent in descents.items()
               for k, error in curves[name].items()])


def method_setups():
    """Return the setups of all methods, those of `DESCENTS` past the paper's tolerance."""
    return [*setups(*DESCENTS, eps=FURTHER, max_iterations=PATIENCE), *setups(*NEWTONS)]


def check_reference(run, step, exact, scale):
    """Record the difference of another method's solution from the reference."""
    check = solve_step(step, "pn-mgpcg", eps=EXACT)
    rms, _ = difference(step, check.dv, exact.dv)
    run.record("hot.fig16.references", rms, unit="1", comparator="<=", bound=1e-6, scale=scale,
               note="two references of different methods, relative to the increment")


def record_method(run, descent, curve, scale):
    """Record iterations, CG, time and error of a method at the paper's tolerance."""
    k, name = descent.first(EPS), descent.report.method
    if k is None:
        run.record(f"hot.fig16.{name}.iterations", None, comparator="info", scale=scale,
                   note=solve_note("the tolerance was not met", descent.report))
        return
    iteration, cg, cpu, _ = descent.rows[k]
    near = min(curve, key=lambda i: (abs(i - k), i))
    rms, cells = curve[near]
    run.record(f"hot.fig16.{name}.iterations", iteration, comparator="info", scale=scale,
               note=f"{cg} of CG, {cpu:.3f} CPU seconds to eps = {EPS:g}")
    run.record(f"hot.fig16.{name}.error", rms, comparator="info", scale=scale,
               note="relative error of the particles' velocity increment there; displacement off "
               f"by {cells:.1e} cells")


def record_slowdown(run, descents, curves, scale):
    """Record ADMM's time over HOT's, to the tolerance and to HOT's error there."""
    hot, admm = descents[HOT], descents[ADMM]
    k, n = hot.first(EPS), admm.first(EPS)
    cpu, theirs, ours = hot.report.cpu_times[k], curves[ADMM], curves[HOT]
    run.record("hot.fig16.admm_slowdown", admm.report.cpu_times[n] / cpu if n else None,
               scale=scale, note=f"CPU time to eps = {EPS:g}; HOT: {cpu:.3f} s, {k} iterations, "
               f"ADMM: {n} iterations, where its error is "
               f"{error_near(theirs, n) / error_near(ours, k):.0f} times HOT's")
    later = first_below(theirs, error_near(ours, k))
    run.record("hot.fig16.equal_error",
               admm.report.cpu_times[later] / cpu if later else None, unit="1", comparator="info",
               scale=scale, note=f"CPU time to HOT's error at eps = {EPS:g}; ADMM: {later} "
               "iterations")


def error_near(curve, k):
    """Return the error of the iterate of a curve that is nearest to the k-th."""
    return curve[min(curve, key=lambda i: abs(i - k))][0]


def first_below(curve, error):
    """Return the first iterate of a curve from which on the error is no larger, or None."""
    larger = [k for k, (rms, _) in curve.items() if rms > error]
    return min((k for k in curve if not larger or k > max(larger)), default=None)


def record_penalties(run, step, exact, scale):
    """Record ADMM with other penalties: the choice is ours, as the paper prints none."""
    for penalty in PENALTIES:
        changes = {"penalty": penalty, "max_iterations": PATIENCE}
        descent = quickest(step, MethodSetup(ADMM, ADMM, changes), 1)
        report, (rms, _) = descent.report, difference(step, descent.dv[-1], exact)
        run.record(f"hot.fig16.admm.penalty-{penalty:g}.iterations", report.iterations,
                   comparator="info", scale=scale,
                   note=solve_note(f"to eps = {EPS:g}, {report.cpu_times[-1]:.3f} CPU seconds; "
                                   f"error {rms:.1e}", report))
