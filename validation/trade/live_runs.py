"""Runs of the bundled study `sway` under gravity that is known only while they go on.

Gravity holds for a tick, of which a run has TICKS. A method is given the gravity of a tick when the
tick begins.
"""

from collections.abc import Callable
from functools import partial
from math import ceil
from time import process_time
from typing import NamedTuple

import numpy as np

from mpm_ref.core.blas import one_thread
from mpm_ref.monitor import Unstable
from mpm_ref.rom.correction import carrier
from mpm_ref.rom.step import BREAKDOWNS
from mpm_ref.rom.study.full_model import field_of, ldm_full_model
from mpm_ref.rom.study.study import load as load_study
from mpm_ref.scene import build
from mpm_ref.simulate import advance, start

from ..common.scenes import SCENES, with_
from .arm_models import TimedPositions

STUDY = SCENES.parent / "studies" / "sway.toml"
TICKS = 18              # of a run
PARTS = 6               # of a tick, at least, after which `LoadTraining` has states
LEVELS = 9              # after as many ticks each, at which states are compared
HOLD = (2, 6)           # ticks for which gravity stays: from the first on, below the second


class LiveMethod(NamedTuple):
    """A method for the positions of a run whose gravity is known only while it goes on."""

    name: str
    begin: Callable         # iterator over the gravity of ticks -> over the states after them
    place: Callable         # state -> x (n, 3)
    fit: float = 0.0        # CPU seconds of what it computes from the training runs
    data: float = 0.0       # ... of the training runs, if it needs them
    pairs: float = 0.0      # ... of those on a coarser grid
    settings: str = ""      # in words


class StepTraining(NamedTuple):
    """Training runs from rest under a constant gravity each, with states after each tick."""

    scene: object           # of one of them
    gravity: np.ndarray     # (runs, 3) [m/s^2]
    X: np.ndarray           # (n, 3) points at rest [m]
    x: np.ndarray           # (runs, TICKS, n, 3) [m]
    F: np.ndarray           # (runs, TICKS, n, 3, 3)
    cpu: float              # CPU seconds of their steps


class LoadTraining(NamedTuple):
    """Training runs from rest under loads, with states after each of some parts of a tick."""

    loads: np.ndarray       # (runs, TICKS, 3) [m/s^2]
    X: np.ndarray           # (n, 3) points at rest [m]
    x: np.ndarray           # (runs, parts * TICKS, n, 3) [m], in single precision: it is large
    cpu: float              # CPU seconds of their steps

    @property
    def parts(self):
        """Number of the parts of a tick."""
        return self.x.shape[1] // TICKS


def sway():
    """Return the bundled study."""
    return load_study(STUDY, {"ldm_gravity": SCENES / "ldm_gravity.toml"})


def training_gravity(study):
    """Return the gravity (runs, 3) of the study's training runs [m/s^2]."""
    return np.array([study.scene(study.mu[k]).gravity for k in study.train])


def sized(scene, dx, transfer=None):
    """Return a scene of the study on a grid of spacing dx [m], with as many particles per cell, at
    most the same time over a cell in a step, and a transfer; None: its own.
    """
    body, ratio = scene.body[0], dx / scene.dx
    sampling = with_(body.sampling, count=round(body.sampling.count / ratio**3))
    steps = TICKS * ceil(scene.steps / ratio / TICKS)
    scheme = with_(scene.scheme, transfer=transfer or scene.scheme.transfer)
    return with_(scene, dx=dx, dt=scene.dt * scene.steps / steps, steps=steps, scheme=scheme,
                 body=(with_(body, sampling=sampling),))


def points_of(scene):
    """Return the points (n, 3) of a scene at rest [m]."""
    return ldm_full_model(scene).X


def drawn_loads(gravity, count, seed):
    """Return loads (count, TICKS, 3): the gravity of each tick [m/s^2], piecewise constant, each
    piece drawn between the least and the largest components of gravity (runs, 3).
    """
    rng, loads = np.random.default_rng(seed), np.empty((count, TICKS, 3))
    low, high = gravity.min(axis=0), gravity.max(axis=0)
    for one in loads:
        k = 0
        while k < TICKS:
            ticks = rng.integers(*HOLD)
            one[k:k + ticks] = rng.uniform(low, high)
            k += ticks
    return loads


def played(method, load):
    """Return the `TimedPositions` of a `LiveMethod` at the levels of a load (ticks, 3)."""
    with one_thread():
        states, x, clock = method.begin(iter(load)), [], process_time()
        try:
            for k, state in enumerate(states, 1):
                if k % (TICKS // LEVELS) == 0:
                    x.append(method.place(state))
        except (Unstable, *BREAKDOWNS):
            return TimedPositions(None, process_time() - clock)
        return TimedPositions(np.array(x), process_time() - clock)


def full_states(scene, load, parts=1):
    """Return the iterator over the bodies of a full-order run of a scene after each tick, or after
    each of some parts of a tick.
    """
    problem = build(scene)
    stepper = problem.stepper()
    state = start(problem, stepper)
    state.account = None        # of the energy, to which changes of gravity add
    return full_steps(problem, stepper, state, load, parts)


def full_steps(problem, stepper, state, load, parts=1):
    """Yield the bodies of a `State` after each of some parts of each tick of a load."""
    for gravity in load:
        stepper.gravity = gravity
        for _ in range(parts):
            for _ in range(problem.clock.steps // TICKS // parts):
                advance(problem, stepper, state)
            yield state.bodies


def full_method(scene):
    """Return the `LiveMethod` of a full-order run of a scene."""
    return LiveMethod(f"full.{scene.scheme.transfer}", partial(full_states, scene),
                      lambda bodies: field_of(bodies, "x"))


def coarse_method(scene, times, X):
    """Return the `LiveMethod` of a full-order run of a scene on a grid `times` as coarse as that of
    points X (n, 3) at rest [m], which its particles carry.
    """
    one = carrier(X, points_of(scene))
    return LiveMethod(f"coarse.{times:g}.{scene.scheme.transfer}", partial(full_states, scene),
                      lambda bodies: one.place(field_of(bodies, "x")))


def step_training(scene, gravity):
    """Return the `StepTraining` of runs of a scene under gravity (runs, 3) [m/s^2]."""
    x, F, cpu = [], [], 0.0
    for one in gravity:
        states = full_states(scene, [one] * TICKS)
        for _ in range(TICKS):
            clock = process_time()
            bodies = next(states)
            cpu += process_time() - clock
            x.append(field_of(bodies, "x"))
            F.append(field_of(bodies, "F"))
    shape = len(gravity), TICKS
    x, F = (np.reshape(a, (*shape, *a[0].shape)) for a in (x, F))
    return StepTraining(scene, gravity, points_of(scene), x, F, cpu)


def load_training(scene, loads, least=PARTS):
    """Return the `LoadTraining` of runs of a scene under loads (runs, TICKS, 3) [m/s^2], with the
    fewest parts of a tick that are at least `least` and divide its steps. Raises ValueError for
    fewer steps in a tick.
    """
    steps, X, cpu = scene.steps // TICKS, points_of(scene), 0.0
    if steps < least:
        raise ValueError(f"{scene.steps} steps: expected at least {least * TICKS}")
    parts = next(n for n in range(least, steps + 1) if steps % n == 0)
    x = np.empty((len(loads), parts * TICKS, *X.shape), np.float32)
    for one, load in zip(x, loads, strict=True):
        clock, states = process_time(), full_states(scene, load, parts)
        for k, bodies in enumerate(states):
            one[k] = field_of(bodies, "x")
        cpu += process_time() - clock
    return LoadTraining(loads, X, x, cpu)
