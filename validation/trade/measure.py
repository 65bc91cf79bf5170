"""Settings of the explicit method, and their measured cost and error: CPU seconds, bytes, and the
end of the run.
"""

from collections.abc import Callable
from dataclasses import replace
from time import process_time
from typing import NamedTuple

import numpy as np

from mpm_ref.explicit import Scheme, Stepper, scatter
from mpm_ref.problem import Problem
from mpm_ref.sampling import Poisson, sample
from mpm_ref.shapes import Box
from mpm_ref.shapes.inside import solid
from mpm_ref.timestep import stable_dt

from ..extremes.long_runs import CARRIED, round_state
from ..extremes.outcome import FINISHED, REFUSED, outcome
from ..verification.lattice import lattice


class ExplicitSetting(NamedTuple):
    """A choice of all knobs."""

    transfer: str = "mls"
    flip: float = 1.0           # share of FLIP against PIC
    degree: int = 2
    cells: int = 16             # over the length of the problem
    per: int = 2                # particles per cell and direction
    sampling: str = "lattice"   # "lattice", "jittered" or "poisson"
    cfl: float = 0.5            # dt over the time in which an elastic wave crosses a cell
    storage: str = "f64"        # of the state between steps; "f32": rounded after every step

    @property
    def scheme(self):
        """The `Scheme` of the setting."""
        return Scheme(self.degree, self.transfer, flip=self.flip)

    def description(self):
        """Return the differences from the default as text."""
        changed = [f"{name} = {value}" for name, value in self._asdict().items()
                   if value != getattr(DEFAULT, name)]
        return ", ".join(changed) or "the default"


DEFAULT = ExplicitSetting()

TRANSFERS = ({"transfer": "pic"}, {"transfer": "flip"}, {"transfer": "flip", "flip": 0.95},
             {"transfer": "apic"})
SAMPLINGS = ({"sampling": "jittered"}, {"sampling": "poisson"})
STORAGE = ({"storage": "f32"},)

# Changes of the default by knob; quick is a part of standard.
QUICK = {
    "dt": tuple({"cfl": c} for c in (0.1, 0.8, 1.0, 1.2, 1.5)),
    "dx": tuple({"cells": n} for n in (8, 32)),
    "particles": tuple({"per": n} for n in (1, 3)),
    "sampling": SAMPLINGS,
    "degree": ({"degree": 3},),
    "transfer": TRANSFERS,
    "storage": STORAGE,
}
STANDARD = {
    "dt": tuple({"cfl": c} for c in (0.05, 0.1, 0.2, 0.8, 1.0, 1.2, 1.5)),
    "dx": tuple({"cells": n} for n in (8, 24, 32, 48, 64, 96)),
    "particles": tuple({"per": n} for n in (1, 3, 4)),
    "sampling": SAMPLINGS,
    # linear splines exist for PIC and FLIP only
    "degree": ({"degree": 3}, {"degree": 1, "transfer": "flip"}, {"degree": 1, "transfer": "pic"},
               {"degree": 3, "per": 3}),
    "transfer": TRANSFERS,
    "storage": STORAGE,
}


def settings(levels):
    """Return (knob, `ExplicitSetting`) of all levels, one knob at a time from the default."""
    chosen = [("default", DEFAULT)]
    for knob, changes in levels.items():
        chosen += [(knob, DEFAULT._replace(**change)) for change in changes]
    return chosen


WRONG = "wrong"         # a run that finished with an error of the size of the answer


class SettingRun(NamedTuple):
    """A problem, a callback after each of its steps, and its error at the end."""

    problem: Problem
    watch: Callable         # (state, dt)
    error: Callable         # () -> error relative to the answer


class MeasuredSetting(NamedTuple):
    """Cost, error and end of one setting."""

    knob: str
    setting: ExplicitSetting
    error: float            # relative; NaN where the run broke
    cpu: float              # seconds of the step loop, smallest of the repeats
    nbytes: int             # of state and grid
    steps: int
    of_bound: float         # dt over the stable time step at the start
    end: str                # FINISHED, WRONG, or the kind of breakdown
    message: str
    refused: bool           # of a broken run: it is refused unless allowed past its bound

    @property
    def good(self):
        """True where the run finished with an answer."""
        return self.end == FINISHED

    @property
    def is_stable(self):
        """True where the time step was within its bound at the start."""
        return self.of_bound <= 1.0


COLUMNS = ("knob", *ExplicitSetting._fields, *MeasuredSetting._fields[2:], "pareto_cpu",
           "pareto_bytes")


def measure(knob, setting, prepare, repeats):
    """Measure a setting; prepare(setting) returns a fresh `SettingRun`.

    The first repeat compiles new kernels; the smallest time excludes that.
    """
    times = []
    for _ in range(repeats):
        trial = prepare(setting)
        size, of_bound = state_bytes(trial.problem, setting), dt_over_bound(trial.problem)
        clock = StepTimer(trial.watch, setting.storage == "f32")
        end = outcome(trial.problem, clock)
        times.append(clock.spent)
        if end.kind != FINISHED:
            break
    error = trial.error() if end.kind == FINISHED else np.nan
    kind = WRONG if error > 1.0 else end.kind
    refused = end.kind != FINISHED and is_refused_at_bound(prepare(setting))
    ends = end.step, of_bound, kind, end.message, refused
    return MeasuredSetting(knob, setting, error, min(times), size, *ends)


def is_refused_at_bound(trial):
    """Return whether the run is refused at some step if it is not allowed past its bound."""
    guarded = replace(trial.problem, allow_unstable=False)
    return outcome(guarded, trial.watch).kind == REFUSED


class StepTimer:
    """Calls a callback after every step and counts the CPU seconds outside of it."""

    def __init__(self, watch, single):
        self.watch, self.single = watch, single
        self.spent, self._since = 0.0, process_time()

    def __call__(self, state, dt):
        """Call the callback, which counts no CPU time."""
        self.spent += process_time() - self._since
        if self.single:
            round_state(state.bodies)
        self.watch(state, dt)
        self._since = process_time()


def started_stepper(problem):
    """Return a stepper that has started on the problem's bodies."""
    stepper = Stepper(problem.scheme, problem.dx, problem.dim, problem.gravity, problem.conditions)
    stepper.start(problem.bodies)
    return stepper


def dt_over_bound(problem):
    """Return the fixed dt of a problem over its stable time step."""
    return problem.clock.dt / stable_dt(problem.bodies, started_stepper(problem)).dt


def state_bytes(problem, setting):
    """Return the bytes of the particles' arrays, each counted once, and of the grid."""
    grid = scatter(problem.bodies, started_stepper(problem).storage, problem.scheme, 0.0)
    size = sum(a.nbytes for a in (grid.m, grid.v, grid.f, grid.v_old))
    for body in problem.bodies:
        arrays = {id(a): (name, a) for name, a in body.particles._asdict().items()}
        for name, a in arrays.values():
            halved = setting.storage == "f32" and name in CARRIED
            size += a.nbytes // 2 if halved else a.nbytes
    return size


def sample_points(setting, lower, upper, seed):
    """Return points (N, 2) in a box for dx = 1/cells, as many as the lattice has."""
    spacing = 1.0 / (setting.cells * setting.per)
    X = lattice(lower, upper, spacing)
    if setting.sampling == "jittered":
        return X + np.random.default_rng(seed).uniform(-0.5, 0.5, X.shape) * spacing
    if setting.sampling == "poisson":
        box = solid(Box(tuple(map(float, lower)), tuple(map(float, upper))))
        return sample(Poisson(count=len(X)), box, 1.0 / setting.cells, seed).x
    return X
