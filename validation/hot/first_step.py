"""Figure 16: the first step of Faceless by every method, ADMM among them.

ADMM's residual is not a measure of its error: where its iterates meet the tolerance, the particles
are further from the solution than those of the others. So its time is compared twice, at the
paper's tolerance and at the error that HOT has there.
"""

from mpm_ref.scene import build

from ..common.registry import experiment
from .iterates import COLUMNS, EPS, Way, errors, first, noted, swiftest, ways
from .one_step import difference, solved
from .warm_states import scene

EXACT = 1e-13               # tolerance of the reference
FURTHER = 1e-9              # to which methods go on whose iterates do not depend on the tolerance
PATIENCE = 2000             # iterations
DESCENTS = ("hot", "hot-quadratic", "lbfgs-h", "lbfgs-gmg", "admm")
NEWTONS = ("pn-pcg", "pn-pcg-mf", "pn-mgpcg", "pn-gmg-pcg", "sgs-pcg")
PENALTIES = (0.1, 0.3, 3.0)         # of ADMM, beside 1
ADMM, HOT = "admm", "hot"


@experiment("hot.fig16", title="First step of Faceless: residual and error by every method",
            profiles=("quick", "standard"), budget={"quick": 10, "standard": 180})
def first_step(run):
    """Residuals of all methods along their way, and ADMM's time over HOT's."""
    step = first(build(scene("faceless", "quick")))
    for way in methods():
        swiftest(step, way, 1, max_iterations=2)                    # compiles
    if run.profile != "quick":
        step = first(build(scene("faceless", "paper")))
    exact = solved(step, "pn-pcg", eps=EXACT)
    scale = (f"{sum(len(b.id) for b in step.bodies)} particles (the paper: 110 000), "
             f"{len(exact.dv)} nodes, dt = {step.dt:.3g} s")
    check_reference(run, step, exact, scale)
    found, curves = {}, {}
    for way in run.progress(methods(), "methods"):
        found[way.name] = swiftest(step, way, run.choose(quick=3, standard=2))
        curves[way.name] = errors(step, found[way.name], exact.dv)
        record_method(run, found[way.name], curves[way.name], scale)
    record_slowdown(run, found, curves, scale)
    record_penalties(run, step, exact.dv, scale)
    run.table("iterates", (*COLUMNS, "error", "cells"),
              [(name, *made.rows[k], *error) for name, made in found.items()
               for k, error in curves[name].items()])


def methods():
    """Every method, those of `DESCENTS` past the paper's tolerance."""
    return [*ways(*DESCENTS, eps=FURTHER, max_iterations=PATIENCE), *ways(*NEWTONS)]


def check_reference(run, step, exact, scale):
    """How far another method's solution is from the reference."""
    check = solved(step, "pn-mgpcg", eps=EXACT)
    rms, _ = difference(step, check.dv, exact.dv)
    run.record("hot.fig16.references", rms, unit="1", comparator="<=", bound=1e-6, scale=scale,
               note="two references of different methods, relative to the increment")


def record_method(run, made, curve, scale):
    """Iterations, CG, time and error of a method where it meets the paper's tolerance."""
    k, name = made.first(EPS), made.report.method
    if k is None:
        run.record(f"hot.fig16.{name}.iterations", None, comparator="info", scale=scale,
                   note=noted("the tolerance was not met", made.report))
        return
    iteration, cg, cpu, _ = made.rows[k]
    near = min(curve, key=lambda i: (abs(i - k), i))
    rms, cells = curve[near]
    run.record(f"hot.fig16.{name}.iterations", iteration, comparator="info", scale=scale,
               note=f"{cg} of CG, {cpu:.3f} CPU seconds to eps = {EPS:g}")
    run.record(f"hot.fig16.{name}.error", rms, comparator="info", scale=scale,
               note="relative error of the particles' velocity increment there; displacement off "
               f"by {cells:.1e} cells")


def record_slowdown(run, found, curves, scale):
    """ADMM's time over HOT's, to the tolerance and to HOT's error there."""
    hot, admm = found[HOT], found[ADMM]
    k, own = hot.first(EPS), admm.first(EPS)
    cpu, theirs, ours = hot.report.cpu_times[k], curves[ADMM], curves[HOT]
    run.record("hot.fig16.admm_slowdown", admm.report.cpu_times[own] / cpu if own else None,
               scale=scale, note=f"CPU time to eps = {EPS:g}; HOT: {cpu:.3f} s, {k} iterations, "
               f"ADMM: {own} iterations, where its error is "
               f"{level(theirs, own) / level(ours, k):.0f} times HOT's")
    later = reached(theirs, level(ours, k))
    run.record("hot.fig16.equal_error",
               admm.report.cpu_times[later] / cpu if later else None, unit="1", comparator="info",
               scale=scale, note=f"CPU time to HOT's error at eps = {EPS:g}; ADMM: {later} "
               "iterations")


def level(curve, k):
    """Error of the iterate nearest to the k-th whose error is known."""
    return curve[min(curve, key=lambda i: abs(i - k))][0]


def reached(curve, error):
    """The first known iterate from which on the error is no larger; None where there is none."""
    late = [k for k, (rms, _) in curve.items() if rms > error]
    after = [k for k in curve if not late or k > max(late)]
    return min(after, default=None)


def record_penalties(run, step, exact, scale):
    """What another penalty does for ADMM: its choice is ours, as the paper prints none."""
    for penalty in PENALTIES:
        changes = {"penalty": penalty, "max_iterations": PATIENCE}
        made = swiftest(step, Way(ADMM, ADMM, changes), 1)
        report, (rms, _) = made.report, difference(step, made.dv[-1], exact)
        run.record(f"hot.fig16.admm.penalty-{penalty:g}.iterations", report.iterations,
                   comparator="info", scale=scale,
                   note=noted(f"to eps = {EPS:g}, {report.cpu_times[-1]:.3f} CPU seconds; error "
                              f"{rms:.1e}", report))
