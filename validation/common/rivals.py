"""The simplest rivals of a reduced run, each with its error, CPU time and memory: training runs
(the nearest, and their linear interpolation), the full model on coarser grids with tracers, and the
full model with MLS-MPM, the fastest transfer, and longer steps.

CPU times are of stepping alone, medians of runs in turn. Errors of the positions are over all
points and times of a test run.
"""

from collections import deque
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from math import inf
from time import process_time
from typing import NamedTuple

import numpy as np

from mpm_ref.monitor import Unstable
from mpm_ref.rom.step import BREAKDOWNS
from mpm_ref.rom.study.errors import PositionErrors, Squares
from mpm_ref.rom.study.evaluate import level_of
from mpm_ref.rom.study.full_model import field_of
from mpm_ref.rom.study.run import step_count
from mpm_ref.scene import SceneError, build
from mpm_ref.simulate import simulate

from .position_errors import record_position_errors
from .scenes import with_
from .tracers import advected

FACTORS = (1.0, 1.5, 2.0, 3.0)      # of the scene's step, with MLS-MPM
NEAREST, INTERPOLATED = "nearest", "interpolated"
COLUMNS = ("scene", "test", "rival", "origin", "centroid", "displacement")


class Rival(NamedTuple):
    """A way to the positions of test runs, with its errors and cost."""

    name: str
    errors: PositionErrors      # infinite where a run ended before its time
    cpu: float                  # of the steps of a run [s]; 0 of training runs, which are looked up
    size: int                  # bytes of what it has to hold


class PositionSource(NamedTuple):
    """A run that gives the positions of a test's points at some times."""

    name: str
    states: Callable        # () -> iterator of (t [s], state)
    place: Callable         # state -> x (n, d) [m]
    size: int


class TestRun(NamedTuple):
    """The positions of a full-order run that others are compared with."""

    __test__ = False        # no test of pytest

    X: np.ndarray           # (n, d) points at the start [m]
    x: np.ndarray           # (k + 1, n, d) at the time levels [m]
    dt: float               # between them [s]
    first: int              # level whose error counts first


class TestRivals(NamedTuple):
    """A test run, its `PositionSource`s, and {name: positions (k + 1, n, d)} of training runs."""

    __test__ = False

    test: TestRun
    sources: list
    trained: dict


class Comparison(NamedTuple):
    """Rivals over some tests, and the errors of each."""

    rivals: list            # `Rival`s with their mean errors
    errors: dict            # {test: {rival: `PositionErrors`}}


def full_source(name, scene):
    """Return the `PositionSource` of a full-order run, each step of which is a frame."""
    def states():
        for frame in simulate(build(scene)):
            yield frame.t, frame.state.bodies
    return PositionSource(name, states, lambda bodies: field_of(bodies, "x"),
                          particle_bytes(build(scene)))


def coarse_sources(scenes, X):
    """Yield the `PositionSource`s of points X (n, d) that go with runs of {times: scene} on coarser
    grids. A scene is left out where the coarse sampling has no point in a body.
    """
    for times, scene in scenes.items():
        try:
            size = particle_bytes(build(scene))
        except SceneError:
            continue
        yield PositionSource(f"coarse.{times}", partial(coarse_states, scene, X), lambda x: x,
                             size + 2 * X.nbytes)


def coarse_states(scene, X):
    """Yield (t, x) of points X that go with a run."""
    yield from advected(build(scene), X)


def stretched(scene, factor):
    """Return the scene with steps `factor` times as long, each of which is a frame. Bounds of the
    time step, which are sufficient and not needed everywhere, do not end it.
    """
    return with_(scene, dt=factor * scene.dt, steps=step_count(scene, factor), every=1,
                 interval=None, unstable="allow")


def mls(scene):
    """Return the scene with MLS-MPM as its transfer."""
    return with_(scene, scheme=with_(scene.scheme, transfer="mls"))


def longest_step(scene):
    """Return the longest of FACTORS with which MLS-MPM comes to the end of a scene. Take a training
    run, so that tests have no part in the choice.
    """
    return max(factor for factor in FACTORS
               if factor == 1.0 or ends(mls(stretched(scene, factor))))


def ends(scene):
    """Return whether a full-order run comes to its end with finite positions."""
    try:
        *_, last = simulate(build(with_(scene, every=scene.steps)))
    except Unstable:
        return False
    return bool(np.isfinite(field_of(last.state.bodies, "x")).all())


def mls_sources(scene, factor):
    """Yield the `PositionSource`s of MLS-MPM with the scene's step, and `factor` times that."""
    for one in sorted({1.0, factor}):
        yield full_source(f"mls.x{one:g}", mls(stretched(scene, one)))


def particle_bytes(problem):
    """Return the bytes of a problem's particles."""
    return sum(nbytes(body.particles) for body in problem.bodies)


def nbytes(record):
    """Return the bytes of all arrays of nested records, each counted once."""
    return sum(a.nbytes for a in {id(a): a for a in arrays_of(record)}.values())


def arrays_of(record):
    """Yield the arrays of nested records."""
    for a in record:
        if isinstance(a, np.ndarray):
            yield a
        elif isinstance(a, tuple):
            yield from arrays_of(a)


def weighted_sum(weights, x):
    """Return sum_k w_k x_k of {k: w_k} and arrays x[k], in double precision."""
    return sum(w * np.asarray(x[k], dtype=float) for k, w in weights.items())


def run_errors(source, test):
    """Return the `PositionErrors` of a `PositionSource` compared with a `TestRun`."""
    squares, last = Squares(test.X), len(test.x) - 1
    try:
        for t, state in source.states():
            level = level_of(t / test.dt)
            if level is not None and test.first <= level <= last:
                squares.add(source.place(state), test.x[level])
    except (Unstable, *BREAKDOWNS):
        return PositionErrors(inf, inf, inf)
    errors = squares.errors
    return errors if np.isfinite(errors).all() else PositionErrors(inf, inf, inf)


def state_errors(x, test):
    """Return the `PositionErrors` of positions x (k + 1, n, d) compared with a `TestRun`."""
    squares = Squares(test.X)
    for state, reference in zip(x[test.first:], test.x[test.first:], strict=True):
        squares.add(state, reference)
    return squares.errors


def cpu_seconds(sources, repeats):
    """Return {name: CPU seconds of the steps of a run}, medians of runs in turn."""
    times = [[cpu_of(source) for source in sources] for _ in range(repeats)]
    return dict(zip((source.name for source in sources), np.median(times, axis=0).tolist(),
                    strict=True))


def cpu_of(source):
    """Return the CPU seconds of the states of a run, as far as it goes."""
    states = source.states()
    start = process_time()
    with suppress(Unstable, *BREAKDOWNS):
        deque(states, maxlen=0)
    return process_time() - start


def compare(tests, repeats):
    """Return the `Comparison` of {name of a test: `TestRivals`}; times are of the first test."""
    errors = {name: {source.name: run_errors(source, one.test) for source in one.sources} | {
        rival: state_errors(x, one.test) for rival, x in one.trained.items()}
        for name, one in tests.items()}
    first = next(iter(tests.values()))
    cpu, size = cpu_seconds(first.sources, repeats), first.test.x.nbytes
    sizes = {source.name: source.size for source in first.sources} | {
        NEAREST: size, INTERPOLATED: 2 * size}
    rivals = [Rival(name, mean_errors(errors, name), cpu.get(name, 0.0), size)
              for name, size in sizes.items() if any(name in own for own in errors.values())]
    return Comparison(rivals, errors)


def mean_errors(errors, name, where=None):
    """Return the mean `PositionErrors` of a rival over {test: {rival: errors}}, of the tests that
    have it and the rival `where`: outside of the training's parameters nothing is interpolated.
    """
    return PositionErrors(*np.mean([own[name] for own in errors.values()
                                    if name in own and (where or name) in own], axis=0))


def record_rivals(run, target, comparison, reduced, scale, origin):
    """Record the errors, CPU time and bytes of each `Rival` of a `Comparison`, and by how much the
    reduced ones, by their names, beat the others; origin: that of the errors, in words.
    """
    for rival in comparison.rivals:
        cost = f"{rival.cpu:.3g} CPU s a run" if rival.cpu else "looked up"
        tests = comparison.errors.values()
        count = f"{sum(rival.name in own for own in tests)} of {len(tests)} tests"
        record_position_errors(run, f"{target}.{rival.name}", rival.errors, scale,
                               f"{cost}; {rival.size / 1e6:.3g} MB; {count}; {origin}",
                               comparator="info")
    for name in reduced:
        record_lookups(run, f"{target}.{name}.beats", comparison, name, scale)
        record_cost(run, f"{target}.{name}.beats.full", comparison, (name, reduced), scale)


def record_lookups(run, target, comparison, name, scale):
    """Record how many times the error of each training rival exceeds that of a reduced run, over
    the tests that have both. A reduced run that broke down beats none.
    """
    for other in (one.name for one in comparison.rivals if one.name in (NEAREST, INTERPOLATED)):
        own = mean_errors(comparison.errors, name, other).origin
        gain = mean_errors(comparison.errors, other).origin / own if np.isfinite(own) else 0.0
        run.record(f"{target}.{other}", gain, unit="x", comparator=">=", bound=1.0, scale=scale,
                   note="its error over that of the reduced run, of the distance from the origin")


def record_cost(run, target, comparison, names, scale):
    """Record how many times the CPU time of the cheapest full-order run of no larger error exceeds
    that of a reduced run; names: its own, and those of all reduced runs. One that broke down saves
    nothing.
    """
    name, reduced = names
    own = next(one for one in comparison.rivals if one.name == name)
    full = [one for one in comparison.rivals if one.name not in (NEAREST, INTERPOLATED, *reduced)
            and one.errors.origin <= own.errors.origin]
    cheapest = min(full, key=lambda one: one.cpu)
    gain = cheapest.cpu / own.cpu if np.isfinite(own.errors.origin) else 0.0
    run.record(target, gain, unit="x", comparator=">=", bound=1.0, scale=scale,
               note=f"CPU time of {cheapest.name}, the cheapest full-order run tried with at most "
               "the error of the reduced run, over its own")


def rows_of(scene, errors):
    """Return rows of COLUMNS of {test: {rival: `PositionErrors`}}."""
    return [(scene, test, rival, *shares) for test, own in errors.items()
            for rival, shares in own.items()]
