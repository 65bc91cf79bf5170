"""Recording of explicit steps: the arrays of every stage, and the error of each number.

Three runs of the same problem go side by side, each from its own states: the kernels; the kernels
with all particles in reverse order, hence with every sum in another order; and the plain twin in
extended precision. The reference's own error of an array is the larger of the kernels' distances to
the other two. In units of round-off times the scale of each entry (see `error_bounds`, for which
more plain twins run along) it becomes one number, from which the tolerances follow:

    tolerance of an entry = MARGIN max(own error, 1) eps * scale of the entry

with the eps of the other code's precision: first-order errors are proportional to it.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ..simulate import State, advance, ended, frame_is_due, next_dt, swiftest, update_bound
from ..store.text import counted
from . import error_bounds, kernel_stages
from .plain_twin import Twin, TwinStep, perturbed_twins
from .schema import LOCATION

MARGIN = 8.0            # factor of another code's errors over the reference's own
EPS = {"f64": error_bounds.EPS, "f32": float(np.finfo(np.float32).eps)}
MAX_ERROR = 1e-7        # of the largest entry: with a larger own error there is no reference


class GoldenArray(NamedTuple):
    """One array of one recorded step, with its errors."""

    value: np.ndarray
    scale: np.ndarray       # per pair, node, particle or energy
    twin: float             # largest distance to the plain twin
    reordered: float        # largest distance to the kernels with particles in reverse order
    error: float            # the larger of both in units of eps(f64) * scale, worst entry

    def tolerance(self, precision):
        """Return the tolerance of an entry, divided by its scale."""
        return MARGIN * max(self.error, 1.0) * EPS[precision]


class GoldenStep(NamedTuple):
    """Contents of a golden file for one step."""

    t: float        # at its start [s]
    dt: float
    nodes: np.ndarray
    bases: dict     # {body name: first node of each particle}
    arrays: dict    # {key: GoldenArray}
    bars: dict      # {key: addition to the tolerance, from that of an implicit solve}
    inputs: dict    # {key: vector that operators of an implicit step are applied to, or seed}
    report: object  # of an implicit solve, or None


def state_after(problem, steps):
    """Return copies of a problem and its `State` after a number of steps of a run.

    Raises as a run does: `Unstable`, `TooLarge`; ValueError where the run ends before.
    """
    problem = copy_problem(problem, 1)
    state = State(problem.bodies, frame=1)        # the first frame is that of the start
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


def record_steps(problem, steps, state=None):
    """Yield one `GoldenStep` for each step; the problem's own arrays stay as they are.

    The first step starts from `state`, by default from the start of the problem. Raises ValueError
    for steps past the end of the run, and where the reference's own error is too large to judge
    other codes by.
    """
    runs = ReferenceRuns(problem, state)
    require_within_run(problem.clock, state, runs.dt, steps)
    for k in range(steps):
        yield runs.step(k)


class StepResults(NamedTuple):
    """Results of a step by the runs that go along with the kernels."""

    exact: TwinStep     # by the plain twin in extended precision
    samples: list       # of `TwinStep`, by the perturbed twins
    kernels: tuple      # {key: array} of the kernels, and of those with particles reversed


class ReferenceRuns:
    """The runs side by side, from a state on, by default the start of the problem."""

    def __init__(self, problem, state=None):
        self.problems = tuple(copy_problem(problem, order) for order in (1, -1))
        self.steppers = [start_stepper(p) for p in self.problems]
        self.twin, self.perturbed = Twin(problem), perturbed_twins(problem)
        self.volumes = {body.name: body.particles.V0 for body in problem.bodies}
        self.dt = step_length(problem, self.steppers[0], state)
        self.start = 0.0 if state is None else state.t
        self.last = None

    @property
    def count(self):
        """Return the number of particles of all bodies."""
        return sum(map(len, self.volumes.values()))

    def step(self, k):
        """Advance all runs by step k and return its `GoldenStep`; `last` has their results."""
        t, (ours, mirrored) = self.start + k * self.dt, self.problems
        arrays, contacts = kernel_stages.step(ours, ours.bodies, self.steppers[0], t, self.dt)
        other, _ = kernel_stages.step(mirrored, mirrored.bodies, self.steppers[1], t, self.dt)
        bases, nodes = stencil_bases(arrays, self.twin.names), arrays["nodes"]
        exact = self.twin.step(self.dt, nodes, contacts, bases)
        samples = [twin.step(self.dt, nodes, contacts, bases) for twin in self.perturbed]
        self.last = StepResults(exact, samples, (arrays, other))
        S = error_bounds.scales(exact.arrays, [sample.arrays for sample in samples], self.count)
        S = error_bounds.with_stress_error(S, self.volumes)
        other = restore_order(other, other["nodes"], nodes)
        recorded = {key: golden_array(arrays[key], S[key], exact.arrays[key], other[key])
                    for key in S if key in arrays}
        require_small_error(recorded, k)
        return GoldenStep(t, self.dt, nodes, bases, recorded, {}, {}, None)


def stencil_bases(arrays, names):
    """Return {body name: first node of each particle}."""
    return {name: arrays[f"{name}/base"] for name in names}


def require_within_run(clock, state, dt, steps):
    """Raise ValueError if a run ends before `steps` steps of dt [s] from a state (None: its start).

    The first of them may always be made.
    """
    first = State((), frame=1) if state is None else state
    for k in range(1, steps):
        if ended(clock, replace(first, step=first.step + k, t=first.t + k * dt)):
            raise ValueError(f"steps = {steps}: the run ends {counted(k, 'step')} after the "
                             f"{first.step} before them; record fewer, or let the scene run longer")


def copy_problem(problem, order):
    """Return the problem with copies of its bodies, particles in order (1) or reversed (-1)."""
    return replace(problem, bodies=tuple(copy_body(body, order) for body in problem.bodies))


def copy_body(body, order):
    """Return a copy of a body, particles in order (1) or reversed (-1); in MLS C and L stay one."""
    q = body.particles
    new = type(q)(*(np.ascontiguousarray(a[::order]).copy() for a in q))
    if q.L is q.C:
        new = new._replace(L=new.C)
    return body._replace(particles=new, id=body.id[::order].copy())


def start_stepper(problem):
    """Return a stepper of the problem; the stress of its bodies is computed."""
    stepper = problem.stepper()
    stepper.start(problem.bodies)
    return stepper


def step_length(problem, stepper, state=None):
    """Return the dt [s] of a run's next step, by default the first.

    It is fixed, or follows from the bounds, the next frame and the end. Raises `Unstable` where no
    adaptive dt is stable.
    """
    state = replace(state or State(problem.bodies, frame=1), bodies=problem.bodies)
    if problem.clock.dt is None:
        update_bound(problem, stepper, state)
    return next_dt(problem.clock, state, swiftest(problem, stepper, state))


def restore_order(arrays, nodes, golden_nodes):
    """Return the arrays {key: array} of the reversed run in the order of the kernels' run.

    Particles are reversed again; grid arrays on `nodes` become those on the golden nodes.
    """
    place = {tuple(i): k for k, i in enumerate(nodes.tolist())}
    index = np.array([place.get(tuple(i), -1) for i in golden_nodes.tolist()])

    def ordered(location, a):
        if location == "nodes":
            return np.where(expand_like(index >= 0, a), a[index], 0)
        return a[::-1] if location in ("particles", "pairs") else a

    return {key: ordered(LOCATION.get(key.split("/")[-1]), a) for key, a in arrays.items()}


def golden_array(value, scale, exact, other):
    """Return the `GoldenArray` of a value, given those of the plain twin and the reversed run."""
    off_twin = abs(value - exact).astype(float)
    off_order = abs(value - other)
    unit = EPS["f64"] * np.maximum(scale, np.finfo(float).tiny)
    worst = max((off / expand_like(unit, off)).max() for off in (off_twin, off_order))
    return GoldenArray(value, scale, float(off_twin.max()), float(off_order.max()), float(worst))


def expand_like(scale, a):
    """Return values of entities (N,) with as many axes as the array a (N, ..) of components."""
    return scale.reshape(scale.shape + (1,) * (a.ndim - scale.ndim))


def require_small_error(arrays, k):
    """Raise ValueError where an own error in step k is too large, or a NaN."""
    for key, a in arrays.items():
        own, largest = max(a.twin, a.reordered), abs(a.value).max()
        if not own <= MAX_ERROR * max(largest, error_bounds.median_scale(a.scale)):
            raise ValueError(
                f"{key} in step {k}: the reference's own error is {own:.1e} at a largest entry of "
                f"{largest:.1e}, too much to judge other codes by; take another state or a smaller "
                "dt"
            )
