"""Several implicit steps in a row, and how all their solves together ended."""

from typing import NamedTuple

import numpy as np

from .hot_solve import CONVERGED, METHODS, STOPPED, End, copied, stepper_of


class Scene(NamedTuple):
    """A setup by name, and for how many steps."""

    name: str
    setup: object
    steps: int


def march(setup, method, steps, **changes):
    """`End` of all steps together, and the bodies after them. It goes on after a step that did not
    converge, and ends where something is not finite.
    """
    bodies, reports = copied(setup.bodies), []
    with np.errstate(all="ignore"):
        stepper = stepper_of(setup._replace(bodies=bodies), method, **changes)
        for k in range(steps):
            stepper.step(bodies, k * setup.dt, setup.dt)
            reports.append(stepper.report)
            if not all(np.isfinite(a).all() for body in bodies for a in body.particles):
                return together(method, reports, f"step {k + 1} left particles not finite"), bodies
    why = next((r.message for r in reports if not r.converged), "")
    return together(method, reports, STOPPED if why else CONVERGED, why), bodies


def together(method, reports, kind, why=""):
    """`End` of several reports: iterations are those of the worst step, inner ones of all."""
    return End(method, kind, max(r.iterations for r in reports),
               sum(r.cg_iterations for r in reports),
               max(r.evaluations for r in reports), sum(r.backtracks for r in reports),
               max(r.residuals[0] for r in reports), max(min(r.residuals) for r in reports),
               sum(sum(r.seconds.values()) for r in reports), why)


def all_of(scenes, methods=METHODS):
    """Rows (name, `End`) of scenes by methods."""
    return [(s.name, march(s.setup, method, s.steps)[0]) for s in scenes for method in methods]
