"""Records explicit steps, and carries the gradient of a loss back through all of them.

    tape = Tape(stepper, bodies)
    for n in range(steps):
        tape.step(n * dt, dt)
    gradient = tape.gradient({steps: [Seed(x=x - x_target)]})

The exact gradient of the discrete run (`adjoint`), as NCLAW-eq4 and NCLAW-eq5 minimise with.
"""

from typing import NamedTuple

import numpy as np

from .adjoint import StepAdjoint, initial_stress_adjoint, zero_bars, zero_sums
from .explicit import Stepper

STATE = ("x", "v", "C", "F", "tau", "y")        # what a step reads and changes


class Seed(NamedTuple):
    """Gradient of a loss with respect to the state of one body after some step; None is zero."""

    x: np.ndarray | None = None
    v: np.ndarray | None = None
    C: np.ndarray | None = None
    F: np.ndarray | None = None
    tau: np.ndarray | None = None
    y: np.ndarray | None = None


class BodyGradient(NamedTuple):
    """Gradient of a loss with respect to one body: its state at the start, and its constants."""

    x: np.ndarray       # (N, d)
    v: np.ndarray       # (N, d)
    C: np.ndarray       # (N, d, d), or (0,) where not carried
    F: np.ndarray       # (N, d, d), or (N,) of J; through the stress too
    y: np.ndarray       # (N,), or (0, 0) where not carried
    m: np.ndarray       # (N,)
    V0: np.ndarray      # (N,)
    b: np.ndarray       # (N, d), or (0,) where not carried
    law: tuple          # the law's record, holding gradients
    flow: tuple         # the flow's record, holding gradients


class Gradient(NamedTuple):
    """Gradient of a loss of a run."""

    bodies: tuple           # of BodyGradient
    gravity: np.ndarray     # (d,)


class Tape:
    """Steps bodies as `stepper` does, to the bit, and remembers the way back.

    The bodies must have been started (`Stepper.start`) and may not be sorted or changed between
    steps. Every `every`-th state is kept; those between are computed anew in the backward sweep.
    Raises ValueError for a stepper without adjoint, or every < 1.
    """

    def __init__(self, stepper, bodies, every=1):
        if every < 1:
            raise ValueError(f"every = {every}: expected a number of steps >= 1")
        self.stepper, self.bodies, self.every = stepper, tuple(bodies), every
        self.adjoint = StepAdjoint(stepper)
        again = stepper.scheme, stepper.dx, len(stepper.gravity), stepper.gravity
        self._again = Stepper(*again, stepper.conditions)
        self._twins = tuple(_twin(body) for body in bodies)
        self._ids = [body.id.copy() for body in bodies]
        self._kept, self._times = [], []

    @property
    def steps(self):
        """Number of steps recorded."""
        return len(self._times)

    def step(self, t, dt):
        """`Stepper.step` of the bodies; returns the grid. Raises ValueError for sorted bodies."""
        for body, ids in zip(self.bodies, self._ids):
            if not np.array_equal(body.id, ids):
                raise ValueError(
                    f"body {body.name!r} was sorted after its tape began: sort before, or start a "
                    "tape of its own for the steps that follow"
                )
        if self.steps % self.every == 0:
            self._kept.append(_state_of(self.bodies))
        grid = self.stepper.step(self.bodies, t, dt)
        self._times.append((t, dt))
        return grid

    def gradient(self, seeds):
        """`Gradient` of a loss. seeds maps a number of steps n (0 .. steps) to one `Seed` or None
        for each body: the loss's gradient with respect to the state after n steps.

        Raises ValueError for seeds that do not fit.
        """
        self._check(seeds)
        bars, sums = _for_each(zero_bars, self._twins), _for_each(zero_sums, self._twins)
        gravity = np.zeros(len(self.stepper.gravity))
        _add(bars, seeds.get(self.steps))
        for k in reversed(range(len(self._kept))):
            states = self._states_from(k)
            for n in reversed(range(k * self.every, k * self.every + len(states))):
                _restore(self._twins, states.pop())
                gravity += self.adjoint.pull_back(self._twins, bars, sums, *self._times[n])
                _add(bars, seeds.get(n))
        for twin, bar, parts in zip(self._twins, bars, sums):
            initial_stress_adjoint(twin, bar, parts)
        return Gradient(tuple(map(_result, self._twins, bars, sums)), gravity)

    def _states_from(self, k):
        """States before the steps from the k-th that was kept up to the next one."""
        states = [self._kept[k]]
        _restore(self._twins, states[0])
        stop = min((k + 1) * self.every, self.steps)
        for t, dt in self._times[k * self.every : stop - 1]:
            self._again.step(self._twins, t, dt)
            states.append(_state_of(self._twins))
        return states

    def _check(self, seeds):
        if not self.steps:
            raise ValueError("the tape is empty: expected at least one step before its gradient")
        for n, of_bodies in seeds.items():
            if n not in range(self.steps + 1):
                raise ValueError(f"seeds of step {n}: expected 0 .. {self.steps}")
            if len(of_bodies) != len(self.bodies):
                raise ValueError(f"{len(of_bodies)} seeds of step {n}: expected one for each of "
                                 f"{len(self.bodies)} bodies, or None")
            for body, seed in zip(self.bodies, of_bodies):
                _check_shapes(body, seed, n)


def _check_shapes(body, seed, n):
    for name in STATE:
        a = getattr(seed, name, None)
        shape = getattr(body.particles, name).shape
        if a is not None and np.shape(a) != shape:
            raise ValueError(f"seed of step {n}, body {body.name!r}: {name} has shape "
                             f"{np.shape(a)}, expected {shape}")


def _for_each(f, bodies):
    return [f(body) for body in bodies]


def _twin(body):
    """A body with arrays of its own for what a step changes."""
    q = body.particles
    own = {name: getattr(q, name).copy() for name in (*STATE, "L")}
    if q.L is q.C:
        own["L"] = own["C"]
    return body._replace(particles=q._replace(**own))


def _state_of(bodies):
    return [[getattr(body.particles, name).copy() for name in STATE] for body in bodies]


def _restore(bodies, state):
    for body, arrays in zip(bodies, state):
        for name, a in zip(STATE, arrays):
            getattr(body.particles, name)[:] = a


def _add(bars, seeds):
    for bar, seed in zip(bars, seeds or ()):
        for name in STATE:
            a = getattr(seed, name, None)
            if a is not None:
                getattr(bar, name)[:] += a


def _result(body, bar, parts):
    total, n = parts.sum(axis=0).tolist(), len(body.law)
    of_law, of_flow = type(body.law)(*total[:n]), type(body.flow)(*total[n:])
    return BodyGradient(bar.x, bar.v, bar.C, bar.F, bar.y, bar.m, bar.V0, bar.b, of_law, of_flow)
