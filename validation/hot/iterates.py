"""One implicit step solved by several methods, with every iterate: residual, CG iterations, CPU
time and the particles' error (Figures 16, 17 and 19).
"""

from typing import NamedTuple

import numpy as np

from mpm_ref.hot.descent import StoppingRule
from mpm_ref.hot.methods import printed, solve
from mpm_ref.hot.report import ProfiledSystem, Profiler, SolveReport
from mpm_ref.simulate import State

from ..common.scenes import evenly
from .one_step import difference, implicit_step
from .warm_states import next_step_length

EPS = 1e-7                  # the paper's tolerance
COLUMNS = ("method", "iteration", "cg", "cpu", "residual")


class MethodSetup(NamedTuple):
    """A method under its name in tables, and the changes of its options."""

    name: str
    method: str
    changes: dict


class Iterates(NamedTuple):
    """A solve and its iterates, the start among them."""

    dv: list            # of (n, d) [m/s]
    cg: list            # CG iterations before each
    report: SolveReport

    @property
    def rows(self):
        """Return (iteration, CG iterations, CPU seconds, residual) of every iterate."""
        return list(zip(range(len(self.cg)), self.cg, self.report.cpu_times, self.report.residuals,
                        strict=True))

    def first(self, eps):
        """Return the number of the first iterate with a residual of at most eps, or None."""
        return next((k for k, r in enumerate(self.report.residuals) if r <= eps), None)


class IterateRecorder(Profiler):
    """A profiler that also records every iterate of a `RecordedSystem`."""

    def __init__(self):
        super().__init__()
        self.dv, self.cg, self.point = [], [], None

    def record(self, residual):
        """Record the residual and the iterate: the point of the last evaluation."""
        super().record(residual)
        self.dv.append(self.point)
        self.cg.append(self.cg_iterations)


class RecordedSystem(ProfiledSystem):
    """A profiled system that passes the points of its evaluations to an `IterateRecorder`."""

    def evaluate(self, dv):
        """Return E(dv) [J] and its gradient (n, d) [kg m/s]."""
        self.profiler.point = dv
        return super().evaluate(dv)


def setups(*names, **changes):
    """Return the `MethodSetup`s of methods, with the same changes for all."""
    return [MethodSetup(name, name, changes) for name in names]


def initial_step(problem):
    """Return the first `ImplicitStep` of a problem, whose bodies it sorts."""
    stepper, state = problem.stepper(), State(problem.bodies, frame=1)
    stepper.start(state.bodies)
    return implicit_step(stepper, state, next_step_length(problem, stepper, state))


def iterates(step, setup, **changes):
    """Return the `Iterates` of a step by a `MethodSetup`, solved as by `methods.minimise`."""
    options = printed(setup.method, **{**setup.changes, **changes})
    profiler = IterateRecorder()
    system = RecordedSystem(step.stepper.system(step.pose), profiler)
    with profiler.part("other"), np.errstate(all="ignore"):
        stop = StoppingRule(options.eps, options.norm, options.max_iterations, options.patience)
        _, why = solve(system, options, stop, profiler)
    return Iterates(profiler.dv, profiler.cg, profiler.report(options.method, why))


def quickest(step, setup, repeats, **changes):
    """Return the `Iterates` of the least CPU time among equal solves."""
    return min((iterates(step, setup, **changes) for _ in range(repeats)),
               key=lambda descent: descent.report.cpu_times[-1])


def iterate_errors(step, descent, exact, most=300):
    """Return {iterate: `difference` to the increment exact} of at most `most` iterates, evenly."""
    return {k: difference(step, descent.dv[k], exact) for k in evenly(len(descent.dv), most)}


def solve_note(text, report):
    """Return a text with remarks on a solve that did not converge, or whose CG was cut."""
    parts = [text]
    if not report.converged:
        parts.append(report.message)
    if report.capped_solves:
        parts.append(f"{report.capped_solves} linear solves, or local steps, short of "
                    "their tolerance")
    return "; ".join(parts)
