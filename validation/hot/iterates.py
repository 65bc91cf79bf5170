"""One implicit step solved by several methods, every iterate kept: residual, CG iterations, CPU
time and the particles' error on the way (Figures 16, 17 and 19).
"""

from typing import NamedTuple

import numpy as np

from mpm_ref.hot.descent import StoppingRule
from mpm_ref.hot.methods import options_of
from mpm_ref.hot.methods import solve as descended
from mpm_ref.hot.report import ProfiledSystem, Profiler, SolveReport
from mpm_ref.simulate import State

from .one_step import Step, difference
from .warm_states import coming

EPS = 1e-7                  # the paper's tolerance
COLUMNS = ("method", "iteration", "cg", "cpu", "residual")


class Way(NamedTuple):
    """A method under the name that it has in tables, and what is changed in it."""

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
        """(iteration, CG iterations, CPU seconds, residual) of every iterate."""
        return list(zip(range(len(self.cg)), self.cg, self.report.cpu_times, self.report.residuals,
                        strict=True))

    def first(self, eps):
        """Number of the first iterate whose residual is at most eps; None where there is none."""
        return next((k for k, r in enumerate(self.report.residuals) if r <= eps), None)


class Keeper(Profiler):
    """A profiler that also remembers every iterate, for a system whose evaluations it is told."""

    def __init__(self):
        super().__init__()
        self.dv, self.cg, self.at = [], [], None

    def record(self, residual):
        """As the profiler's; the iterate is where the potential was evaluated last."""
        super().record(residual)
        self.dv.append(self.at)
        self.cg.append(self.cg_iterations)


class Told(ProfiledSystem):
    """A profiled system that tells a `Keeper` where it is evaluated."""

    def evaluate(self, dv):
        """E(dv) [J] and its gradient (n, d) [kg m/s]."""
        self.profiler.at = dv
        return super().evaluate(dv)


def ways(*names, **changes):
    """`Way`s of methods as they stand, but for changes that all share."""
    return [Way(name, name, changes) for name in names]


def first(problem):
    """The first `Step` of a problem, whose bodies it sorts."""
    stepper, state = problem.stepper(), State(problem.bodies, frame=1)
    stepper.start(state.bodies)
    dt = coming(problem, stepper, state)
    return Step(state.bodies, stepper, stepper.problem(state.bodies, state.t, dt), dt, state.t)


def iterates(step, way, **changes):
    """`Iterates` of a step by a `Way`, with further changes, solved as by `methods.minimise`."""
    options = options_of(way.method, **{**way.changes, **changes})
    profiler = Keeper()
    system = Told(step.stepper.system(step.pose), profiler)
    with profiler.part("other"), np.errstate(all="ignore"):
        stop = StoppingRule(options.eps, options.norm, options.max_iterations, options.patience)
        _, why = descended(system, options, stop, profiler)
    return Iterates(profiler.dv, profiler.cg, profiler.report(options.method, why))


def swiftest(step, way, repeats, **changes):
    """`iterates` that took the least CPU time of so many equal solves."""
    return min((iterates(step, way, **changes) for _ in range(repeats)),
               key=lambda made: made.report.cpu_times[-1])


def spread(last, most):
    """At most so many numbers from 0 to the last, evenly, both among them."""
    return sorted({round(last * k / (most - 1)) for k in range(most)})


def errors(step, made, exact, most=300):
    """{number of an iterate: `difference` to the increment exact}, of a spread of the iterates."""
    return {k: difference(step, made.dv[k], exact) for k in spread(len(made.dv) - 1, most)}


def noted(text, report):
    """A text, and what must be said of a solve that did not converge, or whose CG was cut."""
    said = [text]
    if not report.converged:
        said.append(report.message)
    if report.capped_solves:
        said.append(f"{report.capped_solves} linear solves, or local steps, short of "
                    "their tolerance")
    return "; ".join(said)
