"""A run of a scene from start to end: numbers of every step, and the particles at some times.

A history is stored in a file with the hashes of its scene and of the package, so that a run that is
asked for again is read instead, also after an interruption among several.
"""

import json
from time import process_time
from typing import NamedTuple

import numpy as np

from mpm_ref.body import select_rows
from mpm_ref.core.grid import OutOfRange
from mpm_ref.energy import energy, momentum
from mpm_ref.hot.step import ImplicitStepper
from mpm_ref.monitor import Unstable
from mpm_ref.scene import build
from mpm_ref.scene.toml import digest
from mpm_ref.simulate import State, advance, check, ended, frame_is_due, show
from mpm_ref.store.manifest import peak_memory, source_hash
from mpm_ref.streams import first_bodies, total_bodies
from mpm_ref.timestep import TooLarge

from ..common.provenance import commit
from ..common.results import ROOT
from .run_states import RunStates, even_times

SHOTS = 12          # pictures after that of the start, evenly over the run
COLUMNS = ("step", "t", "dt", "particles", "iterations", "coarse", "residual", "converged",
           "backtracks", "evaluations", "solve", "cpu", "kinetic", "elastic", "gravity", "support",
           "gap")
FIELDS = ("x", "speed", "stress")


class RunHistory(NamedTuple):
    """The history of a run; times in s, CPU times in s, energies in J."""

    steps: np.ndarray       # (steps, len(COLUMNS)); support: force of all conditions [N]; gap: of
                            # the momentum's balance, relative to the momenta in it
    times: np.ndarray       # (shots,)
    body: np.ndarray        # (N,) number of each particle's body, of all that enter too
    x: np.ndarray           # (shots, N, 3) [m], single precision as the next two; NaN until a
                            # particle has entered
    speed: np.ndarray       # (shots, N) [m/s]
    stress: np.ndarray      # (shots, N) Frobenius norm of the Kirchhoff stress [Pa]
    facts: dict             # scene and source (hashes), patience, end, why it ended, mass [kg]
                            # at the start and the end, commit, rejected steps,
                            # memory: peak of the process by the end [bytes]

    def column(self, name):
        """Return one entry of `COLUMNS` at every step."""
        return self.steps[:, COLUMNS.index(name)]


class ImpulseStepper(ImplicitStepper):
    """An implicit stepper that records the momentum which the conditions gave in its step."""

    impulse = np.zeros(3)

    def solve(self, pose):
        """Solve the step; the gradient that remains is the impulse of the conditions."""
        dv = super().solve(pose)
        self.impulse = pose.potential.evaluate(dv)[1].sum(axis=0)
        return dv


def run_history(scene, file, patience, with_states=False):
    """Return the `RunHistory` of a scene: read from the file if it is there, else run and written,
    if asked with its `RunStates` beside it.

    A run ends at the first step past `patience` CPU seconds; an error that breaks it is noted.
    """
    key = {"scene": digest(scene), "patience": patience, "source": source_hash()}
    stored = read(file)
    if stored is not None and {k: stored.facts.get(k) for k in key} == key:
        return stored
    history = run(scene, patience, file if with_states else None)
    history = history._replace(facts={**key, **history.facts, "commit": commit(ROOT),
                                      "memory": peak_memory()})
    write(file, history)
    return history


def run(scene, patience, file=None):
    """Run a scene from its start and return its `RunHistory`; write its `RunStates` beside a file
    of the history, if one is given.
    """
    problem = build(scene)
    stepper = ImpulseStepper(problem.scheme, problem.dx, problem.dim, problem.gravity,
                             problem.conditions, problem.solver)
    state = State(first_bodies(problem.bodies, problem.sources))
    log = Log(problem, stepper, state)
    states = None if file is None else RunStates(unpublished(file.parent), file.stem,
                                                 even_times(problem))
    stepper.start(state.bodies)
    check(problem, state, 0.0)
    log.shot(show(state, 0.0))
    try:
        why = step_to_end(problem, stepper, state, Observers(log, states), patience)
    except (Unstable, OutOfRange, TooLarge) as error:
        why = str(error)
    return log.history(state, why)


class Observers(NamedTuple):
    """The `Log` of a run, and its `RunStates` or None."""

    log: object
    states: RunStates | None


def step_to_end(problem, stepper, state, observers, patience):
    """Step to the end and return the reason for which the run ended."""
    (log, states), start, k = observers, process_time(), 0
    while not ended(problem.clock, state):
        if process_time() - start > patience:
            return f"more than {patience} CPU seconds"
        if states and states.is_due(k, state):
            states.write(k, state, problem)
            k += 1
        counts = [len(body.id) for body in state.bodies]
        before = StepStart(counts, momentum(state.bodies), mass(state.bodies))
        since = process_time()
        dt = advance(problem, stepper, state)
        log.step(state, dt, before, process_time() - since)
        if frame_is_due(problem.clock, state):
            log.shot(show(state, dt))
    return "end"


class StepStart(NamedTuple):
    """Particles, momentum and mass before a step."""

    counts: list            # particles of each body
    momentum: np.ndarray    # (3,) [kg m/s]
    mass: float             # [kg]


def mass(bodies):
    """Return the mass of all particles [kg]."""
    return sum(float(b.particles.m.sum()) for b in bodies)


class Log:
    """The rows and pictures of a run, collected step by step."""

    def __init__(self, problem, stepper, state):
        self.problem, self.stepper, self.rows, self.shots = problem, stepper, [], []
        self.mass = mass(state.bodies)
        self.counts = [len(b.id) for b in total_bodies(problem)]
        frames = round(problem.clock.end / problem.clock.interval)
        self.due = {round(frames * k / SHOTS) for k in range(SHOTS + 1)}

    def step(self, state, dt, before, cpu):
        """Add the row of a step that led from the `StepStart` before to a state."""
        report, q = state.solve, energy(state.bodies, self.problem.gravity, self.problem.inertia)
        self.rows.append((
            state.step, state.t, dt, sum(before.counts), report.iterations,
            report.coarse_iterations, report.residuals[-1],
            report.converged, report.backtracks, report.evaluations, sum(report.seconds.values()),
            cpu, *q, np.linalg.norm(self.stepper.impulse) / dt, self.gap(state, dt, before)))

    def gap(self, state, dt, before):
        """Return the gap of the momentum's balance, relative to the momenta in it.

        It is |P - P_before - dt M g - impulse|; the momenta are those of all particles that the
        step started with, of gravity and of the conditions.
        """
        bodies = [select_rows(b, b.id < n) for b, n in zip(state.bodies, before.counts,
                                                           strict=True)]
        fall, push = dt * before.mass * self.problem.gravity, self.stepper.impulse
        left = momentum(bodies) - before.momentum - fall - push
        size = sum(float(b.particles.m @ np.linalg.norm(b.particles.v, axis=1))
                   for b in bodies) + np.linalg.norm(fall) + np.linalg.norm(push)
        return np.linalg.norm(left) / size if size else 0.0

    def shot(self, frame):
        """Add a picture of a frame that is due."""
        if frame.index in self.due:
            self.shots.append((frame.t, picture(frame.state.bodies, self.counts)))

    def history(self, state, why):
        """Return the `RunHistory`, with a last picture where the run broke off."""
        if state.t > self.shots[-1][0]:
            self.shots.append((state.t, picture(state.bodies, self.counts)))
        times, pictures = zip(*self.shots, strict=True)
        body = np.repeat(np.arange(len(self.counts), dtype=np.uint8), self.counts)
        facts = {"why": why, "end": self.problem.clock.end, "dx": self.problem.dx,
                 "rejected": state.rejected,
                 "mass": [self.mass, mass(state.bodies)]}
        return RunHistory(np.array(self.rows, dtype=float).reshape(-1, len(COLUMNS)),
                      np.array(times), body, *map(np.stack, zip(*pictures, strict=True)), facts)


def picture(bodies, counts):
    """Return x, speed and stress (see `RunHistory`) of particles in the order of their bodies and
    numbers, NaN for those that are not there; counts: particles of each body in the whole run.
    """
    places = np.concatenate([first + b.id for first, b in zip(np.cumsum([0, *counts[:-1]]), bodies,
                                                              strict=True)])
    rows = [(q.x, np.linalg.norm(q.v, axis=1), np.linalg.norm(q.tau.reshape(len(q.x), -1), axis=1))
            for q in (body.particles for body in bodies)]
    return tuple(scatter(np.concatenate(part), places, sum(counts))
                 for part in zip(*rows, strict=True))


def scatter(a, places, count):
    """Return `count` rows in single precision: those of a in their places, NaN elsewhere."""
    rows = np.full((count, *a.shape[1:]), np.nan, dtype=np.float32)
    rows[places] = a
    return rows


def unpublished(folder):
    """Return a folder that is there, and that version control leaves out."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / ".gitignore").write_text("*\n", encoding="utf-8")
    return folder


def write(file, history):
    """Write a history, in a folder that version control leaves out."""
    unpublished(file.parent)
    part = file.with_suffix(".part.npz")
    arrays = {k: v for k, v in history._asdict().items() if k != "facts"}
    np.savez_compressed(part, facts=np.array(json.dumps(history.facts)), **arrays)
    part.replace(file)


def read(file):
    """Return the history in a file, or None if there is no file."""
    if not file.is_file():
        return None
    with np.load(file) as arrays:
        stored = {name: arrays[name] for name in arrays.files}
    return RunHistory(**{**stored, "facts": json.loads(str(stored["facts"]))})
