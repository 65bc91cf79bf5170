"""Recording a golden file: what the kernels compute, stage by stage, and how far it can be trusted.

Three runs of the same problem go side by side, each from its own states: the kernels; the kernels
with all particles in reverse order, hence with all sums in another order; and the plain twin in
extended precision. The reference's own error of an array is the larger of its distances to the
other two. In units of round-off times the scale of each entry (see `error_bounds`, for which more
plain twins go along) it becomes one number, from which the tolerances follow:

    tolerance of an entry = MARGIN max(own error, 1) eps * scale of the entry

with the eps of the other code's precision: first-order errors are proportional to it.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ..explicit import Stepper
from ..simulate import State, advance, ended, frame_is_due, next_dt, swiftest, update_bound
from ..store.words import counted
from . import error_bounds, kernel_stages
from .plain_twin import Twin, TwinStep, perturbed_twins
from .schema import WHERE

MARGIN = 8.0            # another code's errors against the reference's own
EPS = {"f64": error_bounds.EPS, "f32": float(np.finfo(np.float32).eps)}
UNSURE = 1e-7           # of the largest entry: a larger own error is no reference


class Golden(NamedTuple):
    """One array of one step."""

    value: np.ndarray
    scale: np.ndarray       # per pair, node, particle or energy
    twin: float             # largest distance to the plain twin
    reordered: float        # largest distance to the kernels with particles in reverse order
    error: float            # the larger of both in units of eps(f64) * scale, worst entry

    def tolerance(self, precision):
        """Return the tolerance of an entry, divided by its scale."""
        return MARGIN * max(self.error, 1.0) * EPS[precision]


class Recorded(NamedTuple):
    """All that a golden file holds of one step."""

    t: float        # at its start [s]
    dt: float
    nodes: np.ndarray
    bases: dict     # {body name: first node of each particle}
    arrays: dict    # {key: Golden}
    bars: dict      # {key: what the tolerance of an implicit solve adds}
    inputs: dict    # {key: what operators of an implicit step are applied to, or seeds}
    report: object  # of an implicit solve, or None


def advanced(problem, steps):
    """Return (`Problem`, `State`) after so many steps of a run; the given problem's arrays stay.

    Raises as a run does: `Unstable`, `TooLarge`; ValueError where the run ends before.
    """
    problem = problem_of(problem, 1)
    state = State(problem.bodies, frame=1)        # a run has shown its start by then
    if steps:
        stepper = problem.stepper()
        stepper.start(problem.bodies)
        for _ in range(steps):
            if ended(problem.clock, state):
                break
            advance(problem, stepper, state)
            state.frame += frame_is_due(problem.clock, state)
    if ended(problem.clock, state):
        raise ValueError(f"begin after {steps} steps: the run ends after {state.step}")
    return problem, state


def run(problem, steps, state=None):
    """Yield one `Recorded` for each step; the problem's own arrays stay as they are.

    A run stands at `state`, by default at the start of the problem. Raises ValueError for steps
    past its end, and where the reference's own error is too large to judge others by.
    """
    runs = Runs(problem, state)
    refuse_past_end(problem.clock, state, runs.dt, steps)
    for k in range(steps):
        yield runs.step(k)


class LastStep(NamedTuple):
    """How the runs made a step."""

    exact: TwinStep     # by the plain twin in extended precision
    samples: list       # of `TwinStep`, by the perturbed twins
    kernels: tuple      # {key: array} of the kernels, and of those with particles reversed


class Runs:
    """The runs side by side, from a state on, by default the start of the problem."""

    def __init__(self, problem, state=None):
        self.problems = tuple(problem_of(problem, order) for order in (1, -1))
        self.steppers = [started(p) for p in self.problems]
        self.twin, self.perturbed = Twin(problem), perturbed_twins(problem)
        self.volumes = {body.name: body.particles.V0 for body in problem.bodies}
        self.dt = step_length(problem, self.steppers[0], state)
        self.start = 0.0 if state is None else state.t
        self.last = None

    @property
    def count(self):
        """The number of particles."""
        return sum(map(len, self.volumes.values()))

    def step(self, k):
        """Advance all runs by step k and return its `Recorded`; `last` is how they made it."""
        t, (ours, mirrored) = self.start + k * self.dt, self.problems
        arrays, contacts = kernel_stages.step(ours, ours.bodies, self.steppers[0], t, self.dt)
        other, _ = kernel_stages.step(mirrored, mirrored.bodies, self.steppers[1], t, self.dt)
        bases, nodes = bases_of(arrays, self.twin.names), arrays["nodes"]
        exact = self.twin.step(self.dt, nodes, contacts, bases)
        samples = [twin.step(self.dt, nodes, contacts, bases) for twin in self.perturbed]
        self.last = LastStep(exact, samples, (arrays, other))
        S = error_bounds.scales(exact.arrays, [sample.arrays for sample in samples], self.count)
        S = error_bounds.with_stress_error(S, self.volumes)
        other = in_order(other, other["nodes"], nodes)
        recorded = {key: measured(arrays[key], S[key], exact.arrays[key], other[key])
                    for key in S if key in arrays}
        refuse_unsure(recorded, k)
        return Recorded(t, self.dt, nodes, bases, recorded, {}, {}, None)


def bases_of(arrays, names):
    """Return {body name: first node of each particle}."""
    return {name: arrays[f"{name}/base"] for name in names}


def refuse_past_end(clock, state, dt, steps):
    """Raise ValueError if not all of so many steps of dt [s] from a state belong to the run; None
    is its start.
    """
    at = State((), frame=1) if state is None else state
    for k in range(1, steps):
        if ended(clock, replace(at, step=at.step + k, t=at.t + k * dt)):
            raise ValueError(f"steps = {steps}: the run ends {counted(k, 'step')} after the "
                             f"{at.step} before them; record no more, or let the scene run longer")


def problem_of(problem, order):
    """The problem with copies of its bodies, whose particles are in order (1) or reversed (-1)."""
    return replace(problem, bodies=tuple(copied(body, order) for body in problem.bodies))


def copied(body, order):
    """Copy of a body in the same (1) or reverse (-1) order; C and L stay one array in MLS."""
    q = body.particles
    new = type(q)(*(np.ascontiguousarray(a[::order]).copy() for a in q))
    if q.L is q.C:
        new = new._replace(L=new.C)
    return body._replace(particles=new, id=body.id[::order].copy())


def started(problem):
    """A stepper, and the stress of its bodies."""
    stepper = Stepper(problem.scheme, problem.dx, problem.dim, problem.gravity, problem.conditions)
    stepper.start(problem.bodies)
    return stepper


def step_length(problem, stepper, state=None):
    """dt of a run's next step, by default the first: fixed, or as the bounds, the next frame and
    the end let it be. Raises `Unstable` where no adaptive dt is stable.
    """
    state = replace(state or State(problem.bodies, frame=1), bodies=problem.bodies)
    if problem.clock.dt is None:
        update_bound(problem, stepper, state)
    return next_dt(problem.clock, state, swiftest(problem, stepper, state))


def in_order(arrays, nodes, golden_nodes):
    """Return the arrays {key: array} of the reversed run in the order of the other.

    Particles are turned; grid arrays on `nodes` become those on the golden nodes.
    """
    place = {tuple(i): k for k, i in enumerate(nodes.tolist())}
    index = np.array([place.get(tuple(i), -1) for i in golden_nodes.tolist()])

    def ordered(where, a):
        if where == "nodes":
            return np.where(shaped_as(index >= 0, a), a[index], 0)
        return a[::-1] if where in ("particles", "pairs") else a

    return {key: ordered(WHERE.get(key.split("/")[-1]), a) for key, a in arrays.items()}


def measured(value, scale, exact, other):
    """Return the `Golden` of one array, from the plain twin's values and the reversed run's."""
    off_twin = abs(value - exact).astype(float)
    off_order = abs(value - other)
    unit = EPS["f64"] * np.maximum(scale, np.finfo(float).tiny)
    worst = max((off / shaped_as(unit, off)).max() for off in (off_twin, off_order))
    return Golden(value, scale, float(off_twin.max()), float(off_order.max()), float(worst))


def shaped_as(scale, a):
    """Return values of entities (N,) with the axes of an array a (N, ..) that has components."""
    return scale.reshape(scale.shape + (1,) * (a.ndim - scale.ndim))


def refuse_unsure(arrays, k):
    """Raise ValueError where an own error is not small, which a NaN is not either."""
    for key, a in arrays.items():
        own, largest = max(a.twin, a.reordered), abs(a.value).max()
        if not own <= UNSURE * max(largest, error_bounds.typical(a.scale)):
            raise ValueError(
                f"{key} in step {k}: the reference's own error is {own:.1e}, too much beside its "
                f"largest entry {largest:.1e} to judge others by; take another state or a smaller "
                "dt"
            )
