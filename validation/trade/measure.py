"""What a setting costs and how wrong it is: CPU seconds, bytes, error, and how the run ended."""

from collections.abc import Callable
from dataclasses import replace
from time import process_time
from typing import NamedTuple

import numpy as np

from mpm_ref.explicit import Stepper, scatter
from mpm_ref.problem import Problem
from mpm_ref.sampling import Poisson, sample
from mpm_ref.shapes import Box
from mpm_ref.shapes.inside import solid
from mpm_ref.timestep import stable_dt

from ..extremes.long_run import CARRIED, round_state
from ..extremes.outcome import FINISHED, REFUSED, outcome
from ..verification.lattice import lattice
from .knobs import ExplicitSetting

LOST = "wrong"          # a run that ended, with an error of the size of the answer


class Trial(NamedTuple):
    """A problem, what to do after each of its steps, and the error when it has ended."""

    problem: Problem
    watch: Callable         # (state, dt)
    error: Callable         # () -> error relative to the answer


class Point(NamedTuple):
    """One setting, measured."""

    knob: str
    setting: ExplicitSetting
    error: float            # relative; NaN where the run broke
    cpu: float              # seconds of the step loop, smallest of the repeats
    bytes: int              # of state and grid
    steps: int
    of_bound: float         # dt over the stable time step at the start
    end: str                # FINISHED, LOST, or how it broke
    said: str
    refused: bool           # where it broke: whether the run stops at its bound unless allowed on

    @property
    def good(self):
        """Whether the run ended with an answer."""
        return self.end == FINISHED


COLUMNS = ("knob", *ExplicitSetting._fields, *Point._fields[2:], "pareto_cpu", "pareto_bytes")


def measure(knob, setting, prepare, repeats):
    """`Point` of a setting; prepare(setting) makes a fresh `Trial`.

    The first repeat compiles what is new; the smallest time is free of that.
    """
    times = []
    for _ in range(repeats):
        trial = prepare(setting)
        size, of_bound = state_bytes(trial.problem, setting), past(trial.problem)
        clock = Clocked(trial.watch, setting.storage == "f32")
        end = outcome(trial.problem, clock)
        times.append(clock.spent)
        if end.kind != FINISHED:
            break
    error = trial.error() if end.kind == FINISHED else np.nan
    kind = LOST if error > 1.0 else end.kind
    refused = end.kind != FINISHED and is_refused(prepare(setting))
    ends = end.step, of_bound, kind, end.said, refused
    return Point(knob, setting, error, min(times), size, *ends)


def is_refused(trial):
    """Whether the run that is not allowed past its bound, at any step, is refused."""
    guarded = replace(trial.problem, allow_unstable=False)
    return outcome(guarded, trial.watch).kind == REFUSED


class Clocked:
    """Calls a watch after every step and counts the CPU seconds outside of it."""

    def __init__(self, watch, single):
        self.watch, self.single = watch, single
        self.spent, self._since = 0.0, process_time()

    def __call__(self, state, dt):
        """Call the watch; CPU time passes outside of it only."""
        self.spent += process_time() - self._since
        if self.single:
            round_state(state.bodies)
        self.watch(state, dt)
        self._since = process_time()


def started(problem):
    """A stepper, and the stress of its bodies."""
    stepper = Stepper(problem.scheme, problem.dx, problem.dim, problem.gravity, problem.conditions)
    stepper.start(problem.bodies)
    return stepper


def past(problem):
    """The fixed dt of a problem over its stable time step."""
    return problem.clock.dt / stable_dt(problem.bodies, started(problem)).dt


def state_bytes(problem, setting):
    """Bytes of the particles' arrays, each counted once, and of the grid that covers them."""
    grid = scatter(problem.bodies, started(problem).storage, problem.scheme, 0.0)
    size = sum(a.nbytes for a in (grid.m, grid.v, grid.f, grid.v_old))
    for body in problem.bodies:
        arrays = {id(a): (name, a) for name, a in body.particles._asdict().items()}
        for name, a in arrays.values():
            halved = setting.storage == "f32" and name in CARRIED
            size += a.nbytes // 2 if halved else a.nbytes
    return size


def sampled(setting, lower, upper, seed):
    """Points (N, 2) in a box for dx = 1/cells, as many as the lattice has."""
    spacing = 1.0 / (setting.cells * setting.per)
    X = lattice(lower, upper, spacing)
    if setting.sampling == "jittered":
        return X + np.random.default_rng(seed).uniform(-0.5, 0.5, X.shape) * spacing
    if setting.sampling == "poisson":
        box = solid(Box(tuple(map(float, lower)), tuple(map(float, upper))))
        return sample(Poisson(count=len(X)), box, 1.0 / setting.cells, seed).x
    return X


