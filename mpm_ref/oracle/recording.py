"""Recording a golden file: what the kernels compute, stage by stage, and how far it can be trusted.

Three runs of the same problem go side by side, each from its own states: the kernels; the kernels
with all particles in reverse order, hence with all sums in another order; and the plain twin in
extended precision. The reference's own error of an array is the larger of its distances to the
other two. In units of round-off times the scale of each entry (see `scales`) it becomes one number,
from which the tolerances follow:

    tolerance of an entry = MARGIN max(own error, 1) eps * scale of the entry

with the eps of the other code's precision: first-order errors are proportional to it.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ..explicit import Stepper
from ..simulate import State, advance, ended, frame_is_due, next_dt, swiftest, update_bound
from ..store.words import counted
from . import kernel_stages, scaling
from .plain_twin import Twin, placed
from .schema import WHERE

MARGIN = 8.0            # another code's errors against the reference's own
EPS = {"f64": float(np.finfo(np.float64).eps), "f32": float(np.finfo(np.float32).eps)}
UNSURE = 1e-7           # of the largest entry: a larger own error is no reference
FLOOR = 2.0**-24        # of the largest scale: no entry's scale is taken as smaller


class Golden(NamedTuple):
    """One array of one step."""

    value: np.ndarray
    scale: np.ndarray       # per pair, node, particle or energy
    twin: float             # largest distance to the plain twin
    reordered: float        # largest distance to the kernels with particles in reverse order
    error: float            # the larger of both in units of eps(f64) * scale, worst entry

    def tolerance(self, precision):
        """Tolerance of an entry, divided by its scale."""
        return MARGIN * max(self.error, 1.0) * EPS[precision]


class Recorded(NamedTuple):
    """One step."""

    t: float        # at its start [s]
    dt: float
    nodes: np.ndarray
    bases: dict     # {body name: first node of each particle}
    arrays: dict    # {key: Golden}
    bars: dict      # {key: what the tolerance of an implicit solve adds}
    beside: dict    # {key: what operators of an implicit step are applied to}
    report: object  # of an implicit solve, or None


def begun(problem, steps):
    """(`Problem`, `State`) after so many steps of a run; the given problem's arrays stay.

    Raises as a run does: `Unstable`, `TooLarge`.
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
    sides = Sides(problem, state)
    refuse_past_end(problem.clock, state, sides.dt, steps)
    for k in range(steps):
        yield sides.step(k)


class Sides:
    """The three runs side by side, from a state on, by default the start of the problem."""

    def __init__(self, problem, state=None):
        self.runs = tuple(problem_of(problem, order) for order in (1, -1))
        self.steppers = [started(p) for p in self.runs]
        self.twin, self.errors = Twin(problem), [{} for _ in problem.bodies]
        self.dt = step_length(problem, self.steppers[0], state)
        self.start = 0.0 if state is None else state.t
        self.last = None

    def step(self, k):
        """The `Recorded` of step k, which all runs make; `last` is how."""
        t, twin, (ours, mirrored) = self.start + k * self.dt, self.twin, self.runs
        seen, contacts = kernel_stages.step(ours, ours.bodies, self.steppers[0], t, self.dt)
        other, _ = kernel_stages.step(mirrored, mirrored.bodies, self.steppers[1], t, self.dt)
        before = twin.bodies
        exact, done = twin.step(self.dt, seen["nodes"], contacts)
        held = placed(contacts, done.nodes.box, twin.real)
        found = scaling.of_step(twin, before, done, held, self.errors)
        self.last = Last(before, done, held, found, self.errors, (seen, other))
        S = scaling.listed(found, done.nodes.box, seen["nodes"])
        for name in twin.names:
            at = exact[f"{name}/base"], seen[f"{name}/base"]
            exact[f"{name}/weights"] = aligned(exact[f"{name}/weights"], *at)
            S[f"{name}/weights"] = aligned(S[f"{name}/weights"], *at)
        other = unmirrored(other, other["nodes"], seen["nodes"])
        arrays = {key: golden(seen[key], S[key], exact[key], other[key])
                  for key in S if key in seen}
        refuse_unsure(arrays, k)
        self.errors = [{field: arrays[f"{name}/{field}"].twin for field in "xvCF"
                        if f"{name}/{field}" in arrays} for name in twin.names]
        bases = {name: seen[f"{name}/base"] for name in twin.names}
        return Recorded(t, self.dt, seen["nodes"], bases, arrays, {}, {}, None)


class Last(NamedTuple):
    """How the runs made their last step."""

    before: list        # the twin's bodies before it
    done: object        # the twin's `Step`
    contacts: dict      # by the node's index in the twin's box
    found: dict         # {key: scale}, grid arrays over that box
    errors: list        # of what the bodies brought into the step, see `scales.inputs`
    seen: tuple         # {key: array} of the kernels, and of those with particles reversed


def refuse_past_end(clock, state, dt, steps):
    """Raise ValueError if not all of so many steps of dt [s] from a state belong to the run; None
    is its start.
    """
    at = State((), frame=1) if state is None else state
    for k in range(1, steps):
        if ended(clock, replace(at, step=at.step + k, t=at.t + k * dt)):
            raise ValueError(f"steps = {steps}: the run ends {counted(k, 'step')} after the "
                             f"{at.step} before them; record no more, or let the scene run longer")


def aligned(w, base, to):
    """Weights w (N, S) of stencils that begin at the nodes base (N, d), for stencils that begin at
    `to`: 0 where the first do not reach. At a tie, half-way between two nodes for quadratic
    splines, precisions differ on where a stencil begins; the weight of the node in doubt is 0.
    """
    d = base.shape[1]
    width = round(w.shape[1] ** (1.0 / d))
    offset = (to - base)[:, None] + np.indices((width,) * d).reshape(d, -1).T
    reached = ((offset >= 0) & (offset < width)).all(axis=2)
    k = np.moveaxis(np.clip(offset, 0, width - 1), 2, 0)
    return np.where(reached, np.take_along_axis(w, np.ravel_multi_index(k, (width,) * d), 1), 0)


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


def unmirrored(seen, nodes, golden_nodes):
    """What the reversed run saw on its nodes, in the order of the other: particles, and grid arrays
    on the golden nodes.
    """
    place = {tuple(i): k for k, i in enumerate(nodes.tolist())}
    at = np.array([place.get(tuple(i), -1) for i in golden_nodes.tolist()])

    def turned(name, a):
        where = WHERE.get(name)
        if where == "nodes":
            return np.where(shaped(at >= 0, a), a[at], 0)
        return a[::-1] if where in ("particles", "pairs") else a

    return {key: turned(key.split("/")[-1], a) for key, a in seen.items()}


def shaped(mask, a):
    """A mask over the first axis, in as many axes as a has."""
    return mask.reshape(-1, *(1,) * (a.ndim - 1))


def golden(value, scale, exact, other):
    """The `Golden` of one array, from the twin's and the reversed run's."""
    return measured(value, floored(scale), exact, other)


def measured(value, scale, exact, other):
    """The `Golden` of one array with the scales as they are."""
    off_twin = abs(value - exact).astype(float)
    off_order = abs(value - other)
    unit = EPS["f64"] * np.maximum(scale, np.finfo(float).tiny)
    worst = max((off / shaped_as(unit, off)).max() for off in (off_twin, off_order))
    return Golden(value, scale, float(off_twin.max()), float(off_order.max()), float(worst))


def floored(scale):
    """Scales that are nowhere below FLOOR times the largest."""
    return np.maximum(scale, FLOOR * scale.max())


def shaped_as(scale, a):
    """Scales of entities, for arrays that have components too."""
    return scale.reshape(scale.shape + (1,) * (a.ndim - scale.ndim))


def refuse_unsure(arrays, k):
    """Raise ValueError where an own error is not small, which a NaN is not either."""
    for key, a in arrays.items():
        own, largest = max(a.twin, a.reordered), abs(a.value).max()
        if not own <= UNSURE * max(largest, a.scale.max()):
            raise ValueError(
                f"{key} in step {k}: the reference's own error is {own:.1e}, too much beside its "
                f"largest entry {largest:.1e} to judge others by; take another state or a smaller "
                "dt"
            )
