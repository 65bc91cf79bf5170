"""Implicit steps from hard states, solved by several methods, and whether each ended soundly.

A solve is sound if it did no more work than its caps allow, left everything finite, did not raise
the incremental energy, and reports its end correctly: a recomputed gradient confirms that it
converged (HOT-eq9), or a sentence gives the reason why it did not.
"""

from typing import NamedTuple

import numpy as np

from mpm_ref.core.state import Particles
from mpm_ref.explicit import Scheme, deform_body, gather
from mpm_ref.hot.methods import METHODS as ALL
from mpm_ref.hot.methods import printed
from mpm_ref.hot.norms import scaled_norm
from mpm_ref.hot.step import MAX_UPDATES, ImplicitStepper, write_velocities

METHODS = ("hot", "hot-plus", "lbfgs-h", "pn-pcg", "pn-mgpcg")
EPS = 1e-7                          # of the paper
OUTER, CG = 500, 2000               # caps; a sound solve needs less than a fifth of the first
PER_SEARCH = 2 + ALL["hot"].search.cap      # evaluations, at most
SCHEME = Scheme(2, "apic")
CONVERGED, STOPPED = "converged", "stopped"


class StepSetup(NamedTuple):
    """The state and options from which one step starts."""

    bodies: tuple
    dx: float                       # [m]
    dt: float                       # [s]
    gravity: tuple
    conditions: object = None


class SolveEnd(NamedTuple):
    """The end of a solve: CONVERGED, STOPPED with a reason, or a description of its defect."""

    method: str
    kind: str
    iterations: int                 # outer
    inner: int                      # of CG
    evaluations: int
    backtracks: int
    first: float                    # scaled gradient at the start, and the least one
    least: float
    cpu: float                      # [s]
    why: str


def options(method, **changes):
    """Return the method's `SolverOptions`, as HOT prints them, with the caps used here."""
    return printed(method, **{"max_iterations": OUTER, "max_cg_iterations": CG, **changes})


def stepper_of(setup, method, **changes):
    """Return an `ImplicitStepper` that has started on the setup's bodies."""
    stepper = ImplicitStepper(SCHEME, setup.dx, len(setup.gravity), setup.gravity,
                              setup.conditions, options(method, **changes))
    stepper.start(setup.bodies)
    return stepper


def solve(setup, method, **changes):
    """Solve one step on copies of the setup's bodies. Returns its `SolveEnd`."""
    setup = setup._replace(bodies=copy_bodies(setup.bodies))
    with np.errstate(all="ignore"):
        stepper = stepper_of(setup, method, **changes)
        pose = stepper.problem(setup.bodies, 0.0, setup.dt)
        dv = stepper.solve(pose)
        defect = solve_defect(stepper, pose, dv) or particle_defect(stepper, setup, pose, dv)
    r = stepper.report
    kind = defect or (CONVERGED if r.converged else STOPPED)
    return SolveEnd(method, kind, r.iterations, r.cg_iterations, r.evaluations, r.backtracks,
               r.residuals[0], min(r.residuals), sum(r.seconds.values()), r.message)


def copy_bodies(bodies):
    """Return copies of bodies with arrays of their own."""
    return tuple(b._replace(particles=Particles(*(a.copy() for a in b.particles)), id=b.id.copy())
                 for b in bodies)


def solve_defect(stepper, pose, dv):
    """Return what is unsound about a solve, "" if nothing is."""
    r, chosen = stepper.report, stepper.options
    solves = stepper.active_set_updates + 1
    searches = r.iterations + r.restarts + solves
    if (r.iterations > chosen.max_iterations * solves
            or r.cg_iterations > chosen.max_cg_iterations * searches):
        return "more iterations than its caps"
    if r.evaluations > solves + PER_SEARCH * searches or stepper.active_set_updates >= MAX_UPDATES:
        return "more evaluations than its caps"
    if not np.isfinite(dv).all():
        return "increment not finite"
    if not (r.converged or r.message):
        return "no reason given"
    return "" if stepper.active_set_updates else energy_defect(stepper.system(pose), chosen, r, dv)


def energy_defect(system, chosen, report, dv):
    """Return what is wrong with energy or gradient at the increment, "" if nothing is."""
    E, g = system.evaluate(dv)
    E0 = system.energy(system.start)
    noise = 1e3 * chosen.search.noise * abs(E0)     # a line search ignores it
    if np.isfinite(E0) and not E <= E0 + noise:
        return "energy rose"
    if report.converged and not scaled_norm(g, system.kappa) <= chosen.eps:
        return "converged, but its gradient is not small"
    return ""


def particle_defect(stepper, setup, pose, dv):
    """Move the particles by the step. Returns which of their arrays is not finite, "" if none."""
    if not all(np.isfinite(a).all() for b in setup.bodies for a in b.particles):
        return ""                   # they were not finite before
    write_velocities(pose.grid, pose.unknowns, pose.unknowns.v + dv)
    for body in setup.bodies:
        gather(body, pose.grid, stepper.scheme, setup.dt)
        deform_body(body, setup.dt)
        for name, a in zip(Particles._fields, body.particles, strict=True):
            if not np.isfinite(a).all():
                return f"{name} of particles not finite"
    return ""


def record_solves(run, name, ends, scale, note=""):
    """Record the share of sound solves, a list of `SolveEnd`, and each method's convergence."""
    unsound = [f"{e.method}: {e.kind}" for e in ends if e.kind not in (CONVERGED, STOPPED)]
    run.record(f"extremes.hot.{name}.sound", 1.0 - len(unsound) / len(ends), paper=1.0,
               comparator="=", scale=f"{scale}, {len(ends)} solves",
               note="share that ended converged or with a reason, within its caps, finite and at "
                    "no higher energy" + "".join(f"; {defect}" for defect in unsound[:3]))
    for method in dict.fromkeys(e.method for e in ends):
        record_method(run, f"{name}.{method}", [e for e in ends if e.method == method], scale, note)


def record_method(run, name, ends, scale, note):
    """Record the share of one method's solves that converged, and their iterations."""
    stopped = [e for e in ends if e.kind != CONVERGED]
    text = "".join(f"; not converged: {e.why}" for e in stopped[:2])
    text += f"; {note}" if stopped and note else ""
    run.record(f"extremes.hot.{name}.converged", 1.0 - len(stopped) / len(ends), paper=1.0,
               comparator="=", scale=scale,
               note=f"share of {len(ends)} solves that met eps = {EPS:.0e} in {OUTER} iterations: "
                    "the energy is finite and its projected Hessian positive, so that descent must "
                    f"end{text}")
    worst = max(ends, key=lambda e: e.iterations)
    run.record(f"extremes.hot.{name}.iterations", worst.iterations, comparator="info", scale=scale,
               note=f"outer, at most; all solves: {sum(e.inner for e in ends)} of CG, "
                    f"{sum(e.cpu for e in ends):.2f} s CPU")


def solve_table(run, columns, rows):
    """Write the table of solves: rows of the varied values and a `SolveEnd`."""
    run.table("solves", (*columns, *SolveEnd._fields), [(*case, *end) for *case, end in rows])


class StepSequence(NamedTuple):
    """A setup with a name and a number of steps."""

    name: str
    setup: object
    steps: int


def run_steps(setup, method, steps, **changes):
    """Run several steps, also after one that did not converge, until a value is not finite. Returns
    the combined `SolveEnd` and the bodies.
    """
    bodies, reports = copy_bodies(setup.bodies), []
    with np.errstate(all="ignore"):
        stepper = stepper_of(setup._replace(bodies=bodies), method, **changes)
        for k in range(steps):
            stepper.step(bodies, k * setup.dt, setup.dt)
            reports.append(stepper.report)
            if not all(np.isfinite(a).all() for body in bodies for a in body.particles):
                defect = f"step {k + 1} left particles not finite"
                return combined_end(method, reports, defect), bodies
    why = next((r.message for r in reports if not r.converged), "")
    return combined_end(method, reports, STOPPED if why else CONVERGED, why), bodies


def combined_end(method, reports, kind, why=""):
    """Return the `SolveEnd` of several reports: outer iterations of the worst step, inner ones of
    all.
    """
    return SolveEnd(method, kind, max(r.iterations for r in reports),
               sum(r.cg_iterations for r in reports),
               max(r.evaluations for r in reports), sum(r.backtracks for r in reports),
               max(r.residuals[0] for r in reports), max(min(r.residuals) for r in reports),
               sum(sum(r.seconds.values()) for r in reports), why)


def run_by_methods(scenes, methods=METHODS):
    """Return rows (name, `SolveEnd`) of scenes by methods."""
    return [(s.name, run_steps(s.setup, method, s.steps)[0]) for s in scenes for method in methods]
