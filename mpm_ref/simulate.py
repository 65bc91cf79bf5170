"""The only loop over time: it steps, checks, shows frames, and stops with an explanation when a
run becomes unstable.

A run is resumed from a `State`, bit for bit: whatever the loop decides (dt, when to sort, when to
check, whether to shorten a step) is a function of the state alone. `attempt` has the shortening.
"""

from dataclasses import dataclass
from math import ceil, inf
from typing import NamedTuple

from .attempt import take_step
from .body import filled
from .core.grid import OutOfRange
from .monitor import CHECK, Account, account, check, lost, runs_away
from .streams import let_in, next_entry, take_out
from .timestep import TimeStep, TooLarge, advective, refuse, stable_dt

SORT = 64        # steps between physical sorts of the particles by cell
AHEAD = 0.01     # of a step, or of a second, over which the speed of parts is taken
REBOUND = 10     # steps between evaluations of the stable time step
EVEN = 1e-9      # of a step: a frame or end this near is met, whatever the sum of the steps lost
MOST_STEPS = 1e15       # of a run: sums of shorter steps lose their last digit


@dataclass
class State:
    """Everything that a run carries from step to step."""

    bodies: tuple                      # of Body
    step: int = 0
    t: float = 0.0                     # [s]
    frame: int = 0                     # frames shown so far
    bound: float = inf                 # stable dt at its last evaluation [s]
    terms: TimeStep | None = None      # the bounds behind it; none in a state from a file
    account: Account | None = None     # energy at the start
    solve: object = None               # `hot` report of the last step, if it was implicit
    rejected: int = 0                  # steps that failed their checks and were made shorter
    stalled: int = 0                   # implicit steps that ended at their start, out of balance


class Frame(NamedTuple):
    """A state that `simulate` yields. The next step changes its arrays: copy what you keep."""

    index: int      # 0 for the initial state
    t: float        # [s]
    dt: float       # length of the step that led here [s], see `advance`; 0 for the initial state
    state: State


def simulate(problem, state=None, on_step=None):
    """Run a problem, from its start or from a `State`, and yield a `Frame` at every frame time.

    on_step(state, dt) is called after every step, when the state is complete: to save a checkpoint,
    show progress, or end the run by raising. Raises as `start`, `Unstable` (see `monitor`) and
    `TooLarge` (see `timestep`). With a fixed dt, `end` is met by the first step that reaches it.
    """
    stepper = problem.stepper()
    if state is None:
        state = start(problem, stepper)
    if state.frame == 0:
        yield show(state, 0.0)
    while not ended(problem.clock, state):
        try:
            dt = advance(problem, stepper, state)
        except OutOfRange as error:
            check(problem, state, problem.clock.dt or 0.0)
            raise lost(problem, state, problem.clock.dt or 0.0, str(error)) from error
        if on_step is not None:
            on_step(state, dt)
        if frame_is_due(problem.clock, state):
            yield show(state, dt)


def start(problem, stepper):
    """Return the first `State` of a problem, with stress, energy account and stable time step.

    Raises ValueError if a body does not fit the scheme, `Unstable` for a state that is not sound,
    `core.grid.OutOfRange` where no grid covers it, or nodes
    around a source have no number, `TooLarge` for a dt past its bound.
    """
    state = State(problem.bodies)
    stepper.start(filled(state.bodies))
    for source in problem.sources:
        stepper.start((source.entering(0, source.start),))
        stepper.storage.box([source.extremes()])
    check(problem, state, 0.0)
    stepper.storage.cover([body.particles.x for body in filled(state.bodies)])
    state.account = account(problem, state.bodies)
    update_bound(problem, stepper, state)
    return state


def show(state, dt):
    """Return the next frame of a run."""
    frame = Frame(state.frame, state.t, dt, state)
    state.frame += 1
    return frame


def advance(problem, stepper, state):
    """Make one step: sort now and then, choose dt, step, clip, check, then let particles leave and
    enter. Return dt; of an implicit step in parts (see `attempt`), the length of the last part.
    """
    before, bodies = state.t, filled(state.bodies)
    if state.step % SORT == 0 and bodies:
        stepper.sort(bodies)
    if bound_is_due(problem.clock, state):
        update_bound(problem, stepper, state)
    dt = length_of_step(problem, stepper, state)
    if bodies:
        dt = take_step(problem, stepper, state, dt)
    else:
        state.solve = None
    state.step += 1
    state.t = state.step * problem.clock.dt if problem.clock.dt else state.t + dt
    due = state.step % CHECK == 0 or ended(problem.clock, state)
    if due or runs_away(problem, state, dt):
        check(problem, state, dt)
    if problem.sinks:
        take_out(problem, state)
    if problem.sources and let_in(problem, state, before):
        update_bound(problem, stepper, state)
    return dt


def bound_is_due(clock, state):
    """Return whether the stable time step is evaluated before the next step.

    An adaptive dt follows its bound closely; a fixed one is compared with it at checks. `start`
    evaluates the bound of the first step.
    """
    every = REBOUND if clock.dt is None else CHECK
    return (state.step > 0 and state.step % every == 0) or state.bound == inf


def update_bound(problem, stepper, state):
    """Evaluate the stable dt of a state; refuse a fixed dt past it, where the problem says so.

    Raises `TooLarge`, and `Unstable` where no dt is stable.
    """
    bodies = filled(state.bodies)
    terms = stable_dt(bodies, stepper) if bodies else TimeStep(inf, inf, inf)
    if not terms.dt > 0.0:
        check(problem, state, 0.0)
        raise lost(problem, state, 0.0, f"no stable time step: {terms.sentence()}")
    if problem.clock.dt is not None and not problem.allow_unstable:
        refuse(problem.clock.dt, terms, state.step)
    state.bound, state.terms = terms.dt, terms


def swiftest(problem, stepper, state):
    """Return the advective bound of dt as of now [s]; an adaptive step may not wait for
    `update_bound`.

    An implicit step ends with the velocities that parts give, so their speed now bounds it too, as
    in the release of HOT (HOT-dt).
    """
    clock = problem.clock
    if clock.dt is not None:
        return inf
    bodies = filled(state.bodies)
    bound = min((advective(body.particles, problem.dx, 0.0, problem.gravity) for body in bodies),
                default=inf)
    if not (stepper.implicit and bodies):
        return bound
    u = stepper.driven_speed(bodies, state.t, AHEAD * min(next_dt(clock, state, bound), 1.0))
    return min(bound, problem.dx / u) if u > 0.0 else bound


def length_of_step(problem, stepper, state):
    """Return the length of the next step of a run [s], see `next_dt`; without particles, that to
    the next event, or 0 where none is known.
    """
    until = next_entry(problem.sources, state.t)
    dt = next_dt(problem.clock, state, swiftest(problem, stepper, state), until)
    return dt if dt < inf or filled(state.bodies) else 0.0


def next_dt(clock, state, advective_bound, until=inf):
    """Return the length of the next step [s]: fixed, or such that equal steps within the bounds
    meet the next frame, the end or the time `until` [s], whichever is first.

    Raises `TooLarge` where steps are so short that sums of them lose their last digit.
    """
    if clock.dt is not None:
        return clock.dt
    target = until if clock.end is None else min(clock.end, until)
    if clock.interval is not None:
        target = min(target, state.frame * clock.interval)
    dt = min(clock.cfl * min(state.bound, advective_bound), clock.longest)
    if target == inf:
        return dt
    left = (target - state.t) / dt if dt > 0.0 else inf
    if left > MOST_STEPS:
        raise TooLarge(f"dt = {dt:.6g} s is too small: from t = {state.t:.6g} to {target:.6g} s "
                       f"there would be more than {MOST_STEPS:.0e} steps, in which time stands "
                       "still; take a larger `cfl` or `longest`, or another material")
    return (target - state.t) / max(ceil(left - EVEN), 1)


def last_step(clock):
    """Return the number of steps of a run with fixed dt or fixed steps, else None."""
    if clock.steps is not None:
        return clock.steps
    return ceil(clock.end / clock.dt - EVEN) if clock.dt is not None else None


def ended(clock, state):
    """Return whether the run has reached its end."""
    steps = last_step(clock)
    return state.step >= steps if steps is not None else state.t >= clock.end * (1.0 - EVEN)


def frame_is_due(clock, state):
    """Return whether the state just reached is a frame: every `every` steps or `interval` seconds,
    and the end.
    """
    if ended(clock, state):
        return True
    if clock.every is not None:
        return state.step % clock.every == 0
    if clock.interval is not None:
        return state.t >= state.frame * clock.interval * (1.0 - EVEN)
    return False
