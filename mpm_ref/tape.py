"""Records explicit steps, and carries the gradient of a loss back through all of them.

    tape = Tape(stepper, bodies)
    for n in range(steps):
        tape.step(n * dt, dt)
    gradient = tape.gradient({steps: [Seed(x=x - x_target)]})

The exact gradient of the discrete run (`adjoint`), as NCLAW-eq4 and NCLAW-eq5 minimise with.
"""

from collections.abc import Mapping
from math import nan
from typing import NamedTuple

import numpy as np

from .adjoint import (
    StepAdjoint,
    clip_adjoint,
    initial_stress_adjoint,
    is_learned,
    require_adjoint,
    zero_bars,
    zero_sums,
)
from .body import keep_inside
from .explicit import Stepper, initial_stress
from .materials import Hardening, Softening

STATE = ("x", "v", "C", "F", "tau", "y")        # what a step reads and changes
CONSTANT = ("m", "V0", "b")                     # what it reads only
ROUND_OFF = 1e-6        # of a stress that was computed on another way, relative to moduli


class Seed(NamedTuple):
    """Gradient of a loss with respect to the state of one body after some step; None is zero."""

    x: np.ndarray | None = None
    v: np.ndarray | None = None
    C: np.ndarray | None = None
    F: np.ndarray | None = None
    tau: np.ndarray | None = None
    y: np.ndarray | None = None


class BodyGradient(NamedTuple):
    """Gradient of a loss with respect to one body: its state at the start, and its constants.

    Hardening and softening read the y of each particle and never their tau_y, from which bodies
    are made with y. So the gradient by their tau_y takes all y along with it: it is the sum of
    `y`, which holds it already. It is NaN where some particle starts from another y than tau_y.
    """

    x: np.ndarray       # (N, d)
    v: np.ndarray       # (N, d)
    C: np.ndarray       # (N, d, d), or (0,) where not carried
    F: np.ndarray       # (N, d, d), or (N,) of J; through the stress too
    y: np.ndarray       # (N,), or (0, 0) where not carried
    m: np.ndarray       # (N,)
    V0: np.ndarray      # (N,)
    b: np.ndarray       # (N, d), or (0,) where not carried
    law: tuple | None   # the law's record, holding gradients; None of a learned law
    flow: tuple | None  # the flow's record, holding gradients; None beside a learned law


class Gradient(NamedTuple):
    """Gradient of a loss of a run."""

    bodies: tuple           # of BodyGradient
    gravity: np.ndarray     # (d,)


class Tape:
    """Steps bodies as `stepper` does, to the bit, and remembers the way back.

    The bodies must have been started (`Stepper.start`), and nothing but `step` may change them or
    the stepper. Every `every`-th state is kept; those between are computed anew in the backward
    sweep. clip: the box (low, high), (d,) each [m], into which positions are clipped after each
    step, or None; that of a `Problem` is no part of its stepper, and is to be given here.

    Raises ValueError for a stepper, a law or a flow without adjoint, for bodies that were not
    started, for a clip that is no box of d axes, or every < 1.
    """

    def __init__(self, stepper, bodies, every=1, clip=None):
        if every < 1:
            raise ValueError(f"every = {every}: expected a number of steps >= 1")
        self.stepper, self.bodies, self.every = stepper, tuple(bodies), every
        self.clip = None if clip is None else _box(clip, len(stepper.gravity))
        self.adjoint = StepAdjoint(stepper)
        again = stepper.scheme, stepper.dx, len(stepper.gravity), stepper.gravity.copy()
        self._again = Stepper(*again, stepper.conditions)
        self._twins = tuple(map(_started_twin, self.bodies))
        self._left = _state_of(self.bodies)         # by the last step
        self._kept, self._times = [], []

    @property
    def steps(self):
        """Number of steps recorded."""
        return len(self._times)

    def step(self, t, dt):
        """Make `Stepper.step` of the bodies and the clip; return the grid. Raises
        ValueError for bodies or a stepper that something else has changed since the step before.
        """
        _require_same_rules(self.stepper, self._again)
        for body, twin, state in zip(self.bodies, self._twins, self._left):
            _require_untouched(body, twin, state)
        if self.steps % self.every == 0:
            self._kept.append(self._left)
        grid = self._advance(self.stepper, self.bodies, t, dt)
        self._times.append((t, dt))
        self._left = _state_of(self.bodies)
        return grid

    def gradient(self, seeds):
        """Return the `Gradient` of a loss. seeds maps a number of steps n (0 .. steps) to one
        `Seed` or None for each body: the loss's gradient with respect to the state after n steps.

        Raises ValueError for seeds that do not fit.
        """
        self._check(seeds)
        bars, sums = _for_each(zero_bars, self._twins), _for_each(zero_sums, self._twins)
        gravity, after = np.zeros(len(self.stepper.gravity)), self._left
        _add(bars, seeds.get(self.steps))
        for k in reversed(range(len(self._kept))):
            states = self._states_from(k)
            for n in reversed(range(k * self.every, k * self.every + len(states))):
                if self.clip is not None:
                    clip_adjoint((arrays[0] for arrays in after), bars, *self.clip)
                after = states.pop()
                _restore(self._twins, after)
                gravity += self.adjoint.pull_back(self._twins, bars, sums, *self._times[n])
                _add(bars, seeds.get(n))
        for twin, bar, parts in zip(self._twins, bars, sums):
            initial_stress_adjoint(twin, bar, parts)
        return Gradient(tuple(map(_result, self._twins, bars, sums)), gravity)

    def _advance(self, stepper, bodies, t, dt):
        grid = stepper.step(bodies, t, dt)
        if self.clip is not None:
            keep_inside(bodies, *self.clip)
        return grid

    def _states_from(self, k):
        """Return the states before the steps from the k-th stored state to the next one."""
        states = [self._kept[k]]
        _restore(self._twins, states[0])
        stop = min((k + 1) * self.every, self.steps)
        for t, dt in self._times[k * self.every : stop - 1]:
            self._advance(self._again, self._twins, t, dt)
            states.append(_state_of(self._twins))
        return states

    def _check(self, seeds):
        if not self.steps:
            raise ValueError("the tape is empty: expected at least one step before its gradient")
        if not isinstance(seeds, Mapping):
            raise ValueError(f"seeds: given {type(seeds).__name__}, expected a dict of a list for "
                             "each number of steps, as {100: [Seed(x=...)]}")
        if not seeds:
            raise ValueError("seeds: given none, expected the loss's gradient after at least one "
                             "number of steps, as {100: [Seed(x=...)]}")
        for n, of_bodies in seeds.items():
            if n not in range(self.steps + 1):
                raise ValueError(f"seeds of step {n}: expected 0 .. {self.steps}")
            _check_kinds(len(self.bodies), of_bodies, n)
            for body, seed in zip(self.bodies, of_bodies):
                _check_shapes(body, seed, n)


def _box(clip, d):
    """Return (low, high) of a clip, copied."""
    box = np.array(clip, dtype=float)
    if box.shape != (2, d) or not (box[0] < box[1]).all():
        raise ValueError(f"clip = {clip}: expected (low, high), two positions with {d} coordinates "
                         "each, low < high")
    return box


def _require_same_rules(stepper, again):
    same = (np.array_equal(stepper.gravity, again.gravity) and stepper.scheme == again.scheme
            and stepper.conditions is again.conditions)
    if not same:
        raise ValueError("gravity, scheme or conditions of the stepper were changed after its tape "
                         "began: start a tape of its own for the steps that follow")


def _require_untouched(body, twin, state):
    if not np.array_equal(body.id, twin.id):
        raise ValueError(f"body {body.name!r} was sorted after its tape began: sort before, or "
                         "start a tape of its own for the steps that follow")
    known = (*zip(STATE, state), *((name, getattr(twin.particles, name)) for name in CONSTANT))
    for name, a in known:
        if not _same_bits(getattr(body.particles, name), a):
            raise ValueError(f"body {body.name!r}: its {name} was changed by something else than "
                             "the steps of its tape: start a tape of its own for the steps that "
                             "follow, or make the change one of the stepper's conditions")


def _same_bits(a, b):
    return np.array_equal(a.view(np.int64), b.view(np.int64))


def _check_kinds(count, of_bodies, n):
    listed = isinstance(of_bodies, list | tuple) and not isinstance(of_bodies, Seed)
    given = of_bodies if listed else [of_bodies]
    if listed and len(given) == count and all(isinstance(seed, Seed | None) for seed in given):
        return
    said = ", ".join("None" if seed is None else type(seed).__name__ for seed in given)
    raise ValueError(f"seeds of step {n}: given {f'[{said}]' if listed else said}, expected a list "
                     f"with one Seed or None for each body, {count} in all")


def _check_shapes(body, seed, n):
    for name in STATE:
        a = getattr(seed, name, None)
        shape = getattr(body.particles, name).shape
        if a is None:
            continue
        if np.shape(a) != shape:
            raise ValueError(f"seed of step {n}, body {body.name!r}: {name} has shape "
                             f"{np.shape(a)}, expected {shape}")
        if not (np.isrealobj(a) and np.isfinite(a).all()):
            raise ValueError(f"seed of step {n}, body {body.name!r}: {name} has entries that are "
                             "not finite numbers; is the loss finite?")


def _for_each(f, bodies):
    return [f(body) for body in bodies]


def _twin(body):
    """Return a body with arrays of its own."""
    q = body.particles
    own = type(q)(*(a.copy() for a in q))
    if q.L is q.C:
        own = own._replace(L=own.C)
    return body._replace(particles=own, id=body.id.copy())


def _started_twin(body):
    """Return a twin of a body, whose stress must be that of its F, which `Stepper.start` sees
    to.
    """
    require_adjoint(body)
    twin = _twin(body)
    initial_stress(twin)
    tau = twin.particles.tau
    moduli = body.law.unit if is_learned(body) else sum(map(abs, body.law))
    size = moduli + abs(tau).max(initial=0.0)
    if not abs(body.particles.tau - tau).max(initial=0.0) <= ROUND_OFF * size:
        raise ValueError(f"body {body.name!r}: its stress tau is not that of its F: call "
                         "Stepper.start with the bodies before their tape begins")
    return twin


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
    if is_learned(body):
        return BodyGradient(bar.x, bar.v, bar.C, bar.F, bar.y, bar.m, bar.V0, bar.b, None, None)
    total, n = parts.sum(axis=0).tolist(), len(body.law)
    of_law, of_flow = type(body.law)(*total[:n]), type(body.flow)(*total[n:])
    if isinstance(body.flow, Hardening | Softening):
        follows = (body.particles.y == body.flow.tau_y).all()
        of_flow = of_flow._replace(tau_y=bar.y.sum().item() if follows else nan)
    return BodyGradient(bar.x, bar.v, bar.C, bar.F, bar.y, bar.m, bar.V0, bar.b, of_law, of_flow)
