"""A whole run of a scene: what every step took and came to, and the particles at some times.

A course is kept in a file under the hashes of its scene and of the package, so that a run
that is asked for again is read instead, also after an interruption among several.
"""

import json
from time import process_time
from typing import NamedTuple

import numpy as np

from mpm_ref.core.grid import OutOfRange
from mpm_ref.energy import energy, momentum
from mpm_ref.hot.step import ImplicitStepper
from mpm_ref.monitor import Unstable
from mpm_ref.scene import build
from mpm_ref.scene.toml import digest
from mpm_ref.simulate import State, advance, check, ended, frame_is_due, show
from mpm_ref.store.manifest import source_hash
from mpm_ref.timestep import TooLarge

from ..common.provenance import commit
from ..common.results import ROOT

SHOTS = 12          # pictures after that of the start, evenly over the run
COLUMNS = ("step", "t", "dt", "iterations", "coarse", "residual", "converged", "backtracks",
           "evaluations", "solve", "cpu", "kinetic", "elastic", "gravity", "support", "gap")
FIELDS = ("x", "speed", "stress")


class Course(NamedTuple):
    """What is known of a run; times in s, CPU times in s, energies in J."""

    steps: np.ndarray       # (steps, len(COLUMNS)); support: force of all conditions [N]; gap: of
                            # the momentum's balance, relative to the momenta in it
    times: np.ndarray       # (shots,)
    body: np.ndarray        # (N,) number of each particle's body
    x: np.ndarray           # (shots, N, 3) [m], single precision as the next two
    speed: np.ndarray       # (shots, N) [m/s]
    stress: np.ndarray      # (shots, N) Frobenius norm of the Kirchhoff stress [Pa]
    facts: dict             # scene and source (hashes), patience, end, why it ended, mass, commit

    def column(self, name):
        """One entry of `COLUMNS` at every step."""
        return self.steps[:, COLUMNS.index(name)]


class Witness(ImplicitStepper):
    """An implicit stepper that remembers the momentum which the conditions gave in its step."""

    impulse = np.zeros(3)

    def solve(self, pose):
        """As the stepper's; what is left of the gradient is what holds the nodes."""
        dv = super().solve(pose)
        self.impulse = pose.potential.evaluate(dv)[1].sum(axis=0)
        return dv


def course(scene, file, patience):
    """`Course` of a scene, read from the file where it has been run, else run and written.

    A run ends at the first step past `patience` CPU seconds; what breaks it is noted.
    """
    key = {"scene": digest(scene), "patience": patience, "source": source_hash()}
    kept = read(file)
    if kept is not None and {k: kept.facts.get(k) for k in key} == key:
        return kept
    made = run(scene, patience)
    made = made._replace(facts={**key, **made.facts, "commit": commit(ROOT)})
    write(file, made)
    return made


def run(scene, patience):
    """`Course` of a scene from its start."""
    problem = build(scene)
    stepper = Witness(problem.scheme, problem.dx, problem.dim, problem.gravity, problem.conditions,
                      problem.solver)
    state, log = State(problem.bodies), Log(problem, stepper)
    stepper.start(state.bodies)
    check(problem, state, 0.0)
    log.shot(show(state, 0.0))
    try:
        why = stepped(problem, stepper, state, log, patience)
    except (Unstable, OutOfRange, TooLarge) as fault:
        why = str(fault)
    return log.course(state, why)


def stepped(problem, stepper, state, log, patience):
    """Step to the end; returns why the run ended."""
    began = process_time()
    while not ended(problem.clock, state):
        if process_time() - began > patience:
            return f"more than {patience} CPU seconds"
        before, since = momentum(state.bodies), process_time()
        dt = advance(problem, stepper, state)
        log.step(state, dt, before, process_time() - since)
        if frame_is_due(problem.clock, state):
            log.shot(show(state, dt))
    return "end"


class Log:
    """Collects a `Course` while it runs."""

    def __init__(self, problem, stepper):
        self.problem, self.stepper, self.rows, self.shots = problem, stepper, [], []
        self.mass = sum(float(b.particles.m.sum()) for b in problem.bodies)
        frames = round(problem.clock.end / problem.clock.interval)
        self.due = {round(frames * k / SHOTS) for k in range(SHOTS + 1)}

    def step(self, state, dt, before, cpu):
        """Take in a step that led from a momentum to a state."""
        report, q = state.solve, energy(state.bodies, self.problem.gravity, self.problem.inertia)
        self.rows.append((
            state.step, state.t, dt, report.iterations, report.coarse_iterations,
            report.residuals[-1],
            report.converged, report.backtracks, report.evaluations, sum(report.seconds.values()),
            cpu, *q, np.linalg.norm(self.stepper.impulse) / dt, self.gap(state, dt, before)))

    def gap(self, state, dt, before):
        """|P - P_before - dt M g - impulse|, over the momenta that all particles have and those
        that were given.
        """
        fall, push = dt * self.mass * self.problem.gravity, self.stepper.impulse
        left = momentum(state.bodies) - before - fall - push
        size = sum(float(b.particles.m @ np.linalg.norm(b.particles.v, axis=1))
                   for b in state.bodies) + np.linalg.norm(fall) + np.linalg.norm(push)
        return np.linalg.norm(left) / size if size else 0.0

    def shot(self, frame):
        """Keep the particles of a frame that is due."""
        if frame.index in self.due:
            self.shots.append((frame.t, picture(frame.state.bodies)))

    def course(self, state, why):
        """What was collected, with a last picture where the run broke off."""
        if state.t > self.shots[-1][0]:
            self.shots.append((state.t, picture(state.bodies)))
        times, pictures = zip(*self.shots, strict=True)
        body = np.concatenate([np.full(len(b.id), k, np.uint8) for k, b in enumerate(state.bodies)])
        facts = {"why": why, "end": self.problem.clock.end, "dx": self.problem.dx,
                 "mass": [self.mass, sum(float(b.particles.m.sum()) for b in state.bodies)]}
        return Course(np.array(self.rows, dtype=float).reshape(-1, len(COLUMNS)),
                      np.array(times), body, *map(np.stack, zip(*pictures, strict=True)), facts)


def picture(bodies):
    """x, speed and stress (see `Course`) of all particles, body by body in the order of their
    numbers.
    """
    rows = [(q.x, np.linalg.norm(q.v, axis=1), np.linalg.norm(q.tau.reshape(len(q.x), -1), axis=1))
            for q in (body.particles for body in bodies)]
    orders = [np.argsort(body.id) for body in bodies]
    return tuple(np.concatenate([a[order] for a, order in zip(part, orders, strict=True)])
                 .astype(np.float32) for part in zip(*rows, strict=True))


def write(file, made):
    """Write a course, in a folder that version control leaves out."""
    file.parent.mkdir(parents=True, exist_ok=True)
    (file.parent / ".gitignore").write_text("*\n", encoding="utf-8")
    part = file.with_suffix(".part.npz")
    arrays = {k: v for k, v in made._asdict().items() if k != "facts"}
    np.savez_compressed(part, facts=np.array(json.dumps(made.facts)), **arrays)
    part.replace(file)


def read(file):
    """The course in a file; None where there is none."""
    if not file.is_file():
        return None
    with np.load(file) as arrays:
        stored = {name: arrays[name] for name in arrays.files}
    return Course(**{**stored, "facts": json.loads(str(stored["facts"]))})
