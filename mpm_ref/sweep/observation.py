"""One run of a scene, observed: quantities at given times, cost, and how the run ended."""

import time
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from ..core import kernel_cache
from ..core.grid import OutOfRange
from ..executor import stop_asked
from ..indicators import IndicatorWatch
from ..monitor import Unstable
from ..preflight import misplaced
from ..scene import build
from ..scene.toml import parse
from ..scene.validate import validate_scene
from ..simulate import simulate
from ..timestep import TooLarge
from .conditions import record_impulses
from .contacts import REACH, ContactRecorder
from .probes import initial_order, interpolation
from .quantity import OutputQuantity, Snapshot, check_quantities

FINISHED, UNSTABLE, REFUSED, STOPPED = "finished", "unstable", "refused", "too long"
TORN = "torn"           # finished, but a body tore by the grid: see `indicators`
CRASHED = "crashed"     # its process was killed, it had no memory, or a file could not be read
NEAR = 1.5              # steps before an observation from which on quantities are evaluated
PERTURBATION = 1e-10    # cells by which positions are perturbed
FIRST = 2               # steps whose time is that of loading or compiling kernels


class ObservedRun(NamedTuple):
    """A run to be made: plain data, so that any process can make it."""

    scene: str              # JSON text of all its keys
    digest: str             # hash of the scene and of the files that it names
    quantities: tuple       # of texts
    times: tuple            # [s] at which they are sampled, increasing, the first is 0
    probes: tuple           # of (body, positions): `probes.Probe`
    most_cpu: float = np.inf    # [s] after which the run is stopped
    seed: int | None = None     # of a perturbation of the positions; none


@dataclass(frozen=True)
class RunCost:
    """The cost of a run's steps on one thread, without compilation and without observation."""

    cpu: float = np.nan     # [s]
    wall: float = np.nan    # [s]
    steps: int = 0
    particles: int = 0
    memory: int = 0         # bytes of particles and of the grid around them


@dataclass(frozen=True)
class RunObservation:
    """The values of each quantity (T, k), NaN after the run stopped; its cost and its end, and
    what it warned of.
    """

    values: dict
    cost: RunCost
    outcome: str            # FINISHED, UNSTABLE, REFUSED, STOPPED, CRASHED
    message: str = ""
    until: float = 0.0      # [s] that the run reached
    warnings: tuple = ()    # sentences of `preflight` and `indicators`
    indicators: dict = field(default_factory=dict)      # {name: worst value}: `indicators`
    contacts: tuple = ()    # texts of `contacts`

    @property
    def finished(self):
        """Return whether the run reached its end."""
        return self.outcome == FINISHED

    @property
    def tear(self):
        """Return the sentence on the first body that numerical fracture tore, "" without one."""
        return next((text for text in self.warnings if text.startswith("gap: ")), "")

    @property
    def is_sound(self):
        """Return whether the run reached its end with its elastic bodies whole."""
        return self.finished and not self.tear

    @property
    def ending(self):
        """Return the outcome and its message; TORN with its sentence where a body tore."""
        return (TORN, self.tear) if self.finished and self.tear else (self.outcome, self.message)


class _TooLong(Exception):
    """The run has used the CPU time that it may."""


def observe(run):
    """Return the `RunObservation` of an `ObservedRun`. A scene that cannot be run is an outcome."""
    blank = {text: np.full((len(run.times), 0), np.nan) for text in run.quantities}
    try:
        scene = validate_scene(parse(run.scene))
        check_quantities(run.quantities, scene)
        problem, recorder = record_impulses(build(scene), scene)
        observer = RunObserver(problem, run, recorder)
    except (OSError, MemoryError) as fault:
        return RunObservation(blank, RunCost(), CRASHED, str(fault) or "no memory for it")
    except ValueError as fault:
        return RunObservation(blank, RunCost(), REFUSED, str(fault))
    try:
        for frame in simulate(problem, on_step=observer.step):
            if frame.index == 0:
                observer.start()
        outcome, message = FINISHED, ""
    except Unstable as fault:
        outcome, message = UNSTABLE, str(fault)
    except (TooLarge, OutOfRange, ValueError) as fault:
        outcome, message = REFUSED, str(fault)
    except MemoryError:
        outcome, message = CRASHED, "no memory for it"
    except _TooLong:
        outcome, message = STOPPED, f"stopped after {run.most_cpu:.3g} s of CPU time"
    finally:
        observer.close()
    return observer.result(outcome, message)


class RunObserver:
    """Samples quantities at given times while a run is made, and sums the cost of its steps.

    Between two steps a quantity is interpolated linearly in time.
    """

    def __init__(self, problem, run, recorder):
        self._problem, self._run, self._recorder = problem, run, recorder
        self._quantities = [OutputQuantity(text) for text in run.quantities]
        self._starts = {body: np.asarray(X, dtype=float) for body, X in run.probes}
        self._weights = {body.name: interpolation(initial_order(body), self._starts[body.name])
                         for body in problem.bodies if body.name in self._starts}
        if run.seed is not None:        # after the weights, which depend on ties of distances
            perturb(problem, run.seed)
        self._rows, self._before, self._t = [], None, 0.0
        self._clock = StepClock()
        self._nodes = 0
        self._contacts = ContactRecorder(problem)
        self._way = dict.fromkeys((body.name for body in problem.bodies), 0.0)
        self._indicators = IndicatorWatch(problem)
        self._warnings = misplaced(problem)

    def start(self):
        """Sample the first state, and start the clock."""
        self._rows.append(self._sample())
        self._before = 0.0, self._rows[0]
        self._nodes = nodes_around(self._problem)
        self._clock.start()

    def step(self, state, dt):
        """Count a step, and sample the quantities where a time of observation is near."""
        self._clock.stop()
        self._t = state.t
        self._warnings += self._indicators.news(state, dt)
        self._note_contacts(state, dt)
        times, k = self._run.times, len(self._rows)
        if k < len(times) and state.t + NEAR * dt >= times[k]:
            self._sample_step(state.t, times)
        else:
            self._before = None
        if stop_asked():
            raise KeyboardInterrupt
        if self._clock.measured[0] > self._run.most_cpu:
            raise _TooLong
        self._clock.start()

    def _note_contacts(self, state, dt):
        """Note the contacts where bodies may have moved by half of their reach since the last
        time.
        """
        for body in state.bodies:
            self._way[body.name] += dt * np.abs(body.particles.v).max()
        if max(self._way.values()) > 0.25 * REACH * self._problem.dx:
            self._look(state.bodies)

    def _look(self, bodies):
        """Note the contacts of bodies now."""
        self._contacts.note(bodies, self._t, self._way)
        self._way = dict.fromkeys(self._way, 0.0)

    def _sample_step(self, t, times):
        now = self._sample()
        while len(self._rows) < len(times) and times[len(self._rows)] <= t * (1.0 + 1e-9):
            t_k = times[len(self._rows)]
            before = self._before or (t, now)
            share = 1.0 if t <= before[0] else (t_k - before[0]) / (t - before[0])
            self._rows.append([a + share * (b - a) for a, b in zip(before[1], now, strict=True)])
        self._before = t, now

    def _sample(self):
        bodies = self._problem.bodies
        if self._t == 0.0 or any(self._way.values()):       # else nothing has moved since
            self._look(bodies)
        probes = {body.name: self._weights[body.name] @ initial_order(body) for body in bodies
                  if body.name in self._weights}
        impulses = {} if self._recorder is None else self._recorder.impulses()
        snapshot = Snapshot(self._problem, bodies, probes, self._starts, impulses)
        return [quantity.sample(snapshot) for quantity in self._quantities]

    def close(self):
        """End the step that has begun, if any."""
        self._clock.close()

    def result(self, outcome, message):
        """Return the `RunObservation`."""
        n, values = len(self._run.times), {}
        for k, quantity in enumerate(self._quantities):
            rows = np.array([row[k] for row in self._rows])
            samples = np.full((n, rows.shape[1] if rows.ndim == 2 else 0), np.nan)
            samples[:len(rows)] = rows
            values[quantity.text] = quantity.series(samples, self._run.times)
        particles = sum(len(body.id) for body in self._problem.bodies)
        cost = RunCost(*self._clock.total(), self._clock.steps, particles,
                       bytes_of(self._problem.bodies) + self._nodes)
        return RunObservation(values, cost, outcome, message, self._t, tuple(self._warnings),
                              self._indicators.values(), tuple(self._contacts.contacts))


class StepClock:
    """CPU and wall time of steps; those of a step that loaded or compiled kernels are replaced by
    the mean of the others.
    """

    def __init__(self):
        self.steps = self.usual = 0
        self.measured = self.all = 0.0, 0.0     # CPU and wall time of usual and of all steps [s]
        self._compiled = None

    def start(self):
        """Begin a step."""
        self._compiled = _Flag()
        kernel_cache.compilations.append(self._compiled)
        self._begin = time.process_time(), time.perf_counter()

    def stop(self):
        """End a step."""
        cpu, wall = time.process_time() - self._begin[0], time.perf_counter() - self._begin[1]
        compiled = self._compiled.raised
        self.close()
        self.steps += 1
        self.all = self.all[0] + cpu, self.all[1] + wall
        if self.steps > FIRST and not compiled:
            self.usual += 1
            self.measured = self.measured[0] + cpu, self.measured[1] + wall

    def close(self):
        """Forget a step that has begun."""
        if self._compiled is not None:
            kernel_cache.compilations.remove(self._compiled)
        self._compiled = None

    def total(self):
        """Return the CPU and wall time of all steps [s]: as measured, with the loading of kernels,
        where no step was usual; NaN without a step.
        """
        if not self.steps:
            return np.nan, np.nan
        if not self.usual:
            return self.all
        return tuple(sum_ * self.steps / self.usual for sum_ in self.measured)


class _Flag:
    """A function without arguments that notes that it was called."""

    raised = False

    def __call__(self):
        self.raised = True


def perturb(problem, seed):
    """Move each particle by a random vector of `PERTURBATION` cells, in place."""
    rng = np.random.default_rng(seed)
    for body in problem.bodies:
        x = body.particles.x
        x += PERTURBATION * problem.dx * rng.standard_normal(x.shape)


def nodes_around(problem):
    """Return the bytes of a grid (mass, velocity) over the box of all particles."""
    x = np.concatenate([body.particles.x for body in problem.bodies])
    cells = np.ceil((x.max(axis=0) - x.min(axis=0)) / problem.dx) + problem.scheme.degree + 1
    return int(np.prod(cells)) * x.itemsize * (1 + problem.dim)


def bytes_of(bodies):
    """Return the bytes of the particles' arrays."""
    return sum(field.nbytes for body in bodies for field in body.particles)
