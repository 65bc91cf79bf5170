"""One implicit step from a hard state, solved by several methods, and whether each ended soundly.

A solve is sound if it did no more work than its caps allow, left everything finite, did not raise
the incremental energy, and is right about itself: a gradient computed anew agrees that it converged
(HOT-eq9), or a sentence says why it did not.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from mpm_ref.core.state import Particles
from mpm_ref.explicit import Scheme, deform_body, gather
from mpm_ref.hot.methods import METHODS as ALL
from mpm_ref.hot.norms import scaled_norm
from mpm_ref.hot.step import MAX_UPDATES, ImplicitStepper, write_velocities

METHODS = ("hot", "hot-plus", "lbfgs-h", "pn-pcg", "pn-mgpcg")
EPS = 1e-7                          # the paper's
OUTER, CG = 500, 2000               # caps; no solve here is known to need a fifth of the first
PER_SEARCH = 2 + ALL["hot"].search.cap      # evaluations, at most
SCHEME = Scheme(2, "apic")
CONVERGED, STOPPED = "converged", "stopped"


class Setup(NamedTuple):
    """What one step starts from."""

    bodies: tuple
    dx: float                       # [m]
    dt: float                       # [s]
    gravity: tuple
    conditions: object = None


class End(NamedTuple):
    """How a solve went: CONVERGED, STOPPED with a reason, or what is unsound about it."""

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
    """The method's `Options` with the caps of these experiments."""
    return replace(ALL[method], **{"max_iterations": OUTER, "max_cg_iterations": CG, **changes})


def stepper_of(setup, method, **changes):
    """An `ImplicitStepper` that has started on the setup's bodies."""
    stepper = ImplicitStepper(SCHEME, setup.dx, len(setup.gravity), setup.gravity,
                              setup.conditions, options(method, **changes))
    stepper.start(setup.bodies)
    return stepper


def solve(setup, method, **changes):
    """`End` of one step; the setup's bodies stay as they are."""
    setup = setup._replace(bodies=copied(setup.bodies))
    with np.errstate(all="ignore"):
        stepper = stepper_of(setup, method, **changes)
        pose = stepper.problem(setup.bodies, 0.0, setup.dt)
        dv = stepper.solve(pose)
        wrong = wrong_with(stepper, pose, dv) or wrong_after(stepper, setup, pose, dv)
    r = stepper.report
    kind = wrong or (CONVERGED if r.converged else STOPPED)
    return End(method, kind, r.iterations, r.cg_iterations, r.evaluations, r.backtracks,
               r.residuals[0], min(r.residuals), sum(r.seconds.values()), r.message)


def copied(bodies):
    """Bodies with arrays of their own."""
    return tuple(b._replace(particles=Particles(*(a.copy() for a in b.particles)), id=b.id.copy())
                 for b in bodies)


def wrong_with(stepper, pose, dv):
    """What a solve did that it must not do; "" if nothing."""
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
    return "" if stepper.active_set_updates else wrong_at(stepper.system(pose), chosen, r, dv)


def wrong_at(system, chosen, report, dv):
    """As `wrong_with`, for energy and gradient at the increment, under the pose's conditions."""
    E, g = system.evaluate(dv)
    E0 = system.energy(system.start)
    noise = 1e3 * chosen.search.noise * abs(E0)     # a line search may take it for none, in a step
    if np.isfinite(E0) and not E <= E0 + noise:
        return "energy rose"
    if report.converged and not scaled_norm(g, system.kappa) <= chosen.eps:
        return "converged, but its gradient is not small"
    return ""


def wrong_after(stepper, setup, pose, dv):
    """Moves the particles by the step: what of them is not finite then; "" if nothing."""
    if not all(np.isfinite(a).all() for b in setup.bodies for a in b.particles):
        return ""                   # nor was it before
    write_velocities(pose.grid, pose.unknowns, pose.unknowns.v + dv)
    for body in setup.bodies:
        gather(body, pose.grid, stepper.scheme, setup.dt)
        deform_body(body, setup.dt)
        for name, a in zip(Particles._fields, body.particles, strict=True):
            if not np.isfinite(a).all():
                return f"{name} of particles not finite"
    return ""


def record_ends(run, name, ends, scale, note=""):
    """What the solves of an experiment say together: `ends` is a list of `End`."""
    unsound = [f"{e.method}: {e.kind}" for e in ends if e.kind not in (CONVERGED, STOPPED)]
    run.record(f"extremes.hot.{name}.sound", 1.0 - len(unsound) / len(ends), paper=1.0,
               comparator="=", scale=f"{scale}, {len(ends)} solves",
               note="share that ended converged or with a reason, within its caps, finite and at "
                    "no higher energy" + "".join(f"; {said}" for said in unsound[:3]))
    for method in dict.fromkeys(e.method for e in ends):
        record_method(run, f"{name}.{method}", [e for e in ends if e.method == method], scale, note)


def record_method(run, name, ends, scale, note):
    """Share of one method's solves that converged, and their iterations."""
    stopped = [e for e in ends if e.kind != CONVERGED]
    said = "".join(f"; not: {e.why}" for e in stopped[:2])
    said += f"; {note}" if stopped and note else ""
    run.record(f"extremes.hot.{name}.converged", 1.0 - len(stopped) / len(ends), paper=1.0,
               comparator="=", scale=scale,
               note=f"share of {len(ends)} solves that met eps = {EPS:.0e} in {OUTER} iterations: "
                    "the energy is finite and its projected Hessian positive, so that descent must "
                    f"end{said}")
    worst = max(ends, key=lambda e: e.iterations)
    run.record(f"extremes.hot.{name}.iterations", worst.iterations, comparator="info", scale=scale,
               note=f"outer, at most; all solves: {sum(e.inner for e in ends)} of CG, "
                    f"{sum(e.cpu for e in ends):.2f} s CPU")


def table_of(run, columns, rows):
    """Write the rows, each what was varied and its `End`."""
    run.table("solves", (*columns, *End._fields), [(*case, *end) for *case, end in rows])
