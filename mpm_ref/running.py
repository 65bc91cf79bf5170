"""A run on files: frames stream into the results, checkpoints save the state, and whatever ends the
run ends it between two steps, so that it can be continued bit for bit."""

import signal
import threading
import time
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from . import checkpoint
from .core.grid import OutOfRange
from .energy import energy
from .explicit import Stepper
from .manifest import Part, manifest
from .monitor import Unstable, check
from .simulate import Frame, ended, frame_is_due, simulate
from .store import Fields, create, reopen
from .timestep import TooLarge, refuse, stable_dt

SECONDS = 60.0     # between checkpoints, unless a number of steps is given
FINISHED, AT_LIMIT, INTERRUPTED, TERMINATED = "finished", "step limit", "interrupted", "terminated"
SIGNALS = {signal.SIGINT: INTERRUPTED, signal.SIGTERM: TERMINATED}


class Refused(ValueError):
    """A run that was asked for would destroy, or cannot find, an earlier one."""


@dataclass(frozen=True)
class Options:
    """How a run is recorded.

    steps: stop after this many steps in all, to be continued later; checkpoint_every: steps between
    checkpoints, None for one a minute; resume: go on from the checkpoint beside the results, or
    begin where there is none; overwrite: replace the results of an earlier run.
    """

    steps: int | None = None
    checkpoint_every: int | None = None
    fields: Fields = field(default_factory=Fields)
    resume: bool = False
    overwrite: bool = False
    seed: int | None = None

    def __post_init__(self):
        for name in ("steps", "checkpoint_every"):
            if getattr(self, name) is not None and getattr(self, name) < 1:
                raise ValueError(f"{name} = {getattr(self, name)}: expected a number of steps >= 1")
        if self.resume and self.overwrite:
            raise ValueError("resume and overwrite: give at most one of the two")


@dataclass(frozen=True)
class Outcome:
    """How a run ended: why ("finished", "step limit", "interrupted", "terminated"), the `State` it
    ended with, frames stored, and whether it went on with the very code that began it."""

    why: str
    state: object
    frames: int
    same_code: bool


class Watch:
    """What a run tells while it goes on; this one does not listen."""

    def begin(self, problem, state):
        """A run begins, or goes on from a state (None: from its start)."""

    def step(self, state, dt):
        """A step of length dt [s] was made."""

    def frame(self, frame, energy):
        """A frame was stored."""


class _Stop(Exception):
    """Raised between two steps, by the run itself."""


def checkpoint_of(out):
    """Path of the checkpoint that belongs to a results file: run.h5 -> run.checkpoint.h5."""
    return Path(out).with_suffix(".checkpoint.h5")


def run(problem, out, options=None, watch=None):
    """Run a `Problem` into the results file `out`, and return an `Outcome`.

    SIGINT and SIGTERM end the run after the step being made, with a checkpoint. A run that becomes
    unstable raises `Unstable`, `OutOfRange` or `TooLarge`; the last checkpoint, made of a state that
    passed all checks, then stands. Raises `Refused`, `BadCheckpoint`, `BadResults`, `InUse`
    or `NotWritten` where files stand in the way. The arrays of the problem's bodies are changed.
    """
    options, watch = options or Options(), watch or Watch()
    state, same_code = _where_to_begin(problem, out, options)
    if state is not None and _over(problem, state, options):
        return Outcome(_why_over(problem, state), state, state.frame, same_code)
    if state is None:
        require_stable(problem)
    writer = _open(problem, out, options, state)
    try:
        session = _Session(problem, Path(out), options, watch, writer)
        watch.begin(problem, state)
        why = session.loop(state)
        return Outcome(why, session.state, len(writer), same_code)
    finally:
        writer.close()


def _where_to_begin(problem, out, options):
    """(state of the checkpoint or None, whether it was saved by this very code)."""
    path = checkpoint_of(out)
    if options.resume and path.exists():
        if not Path(out).exists():
            raise Refused(f"{out}: there are no results beside the checkpoint {path}; "
                          "put them back, or remove the checkpoint to begin anew")
        return checkpoint.load(path, problem)
    if Path(out).exists() and not (options.resume or options.overwrite):
        raise Refused(f"{out} exists: add --resume to continue it, --overwrite to replace it, "
                      "or name another file")
    return None, True


def _open(problem, out, options, state):
    """Writer of the results, and a manifest in it."""
    if options.resume and Path(out).exists():
        return reopen(out, problem, state.frame if state else 0)
    writer = create(out, problem, options.fields, manifest(problem, options.seed))
    checkpoint_of(out).unlink(missing_ok=True)
    return writer


def require_stable(problem):
    """Raise `TooLarge` before anything is written, if a fixed dt is past its bound at the start."""
    if problem.clock.dt is not None and not problem.allow_unstable:
        refuse(problem.clock.dt, bounds(problem))


def bounds(problem):
    """`TimeStep` of a problem's bodies as they stand."""
    stepper = Stepper(problem.scheme, problem.dx, problem.dim, problem.gravity)
    return stable_dt(problem.bodies, stepper)


def _over(problem, state, options):
    return ended(problem.clock, state) or (options.steps is not None and state.step >= options.steps)


def _why_over(problem, state):
    return FINISHED if ended(problem.clock, state) else AT_LIMIT


class _Session:
    """One part of a run. Decides, whenever the state stands whole, whether to save it and to stop."""

    def __init__(self, problem, out, options, watch, writer):
        self.problem, self.out, self.options = problem, out, options
        self.watch, self.writer = watch, writer
        self.state, self.dt, self.asked = None, 0.0, None
        self.shown = self.saved = None        # steps at which a frame, a checkpoint was last stored
        self.saved_at = time.perf_counter()

    def loop(self, state):
        """Run to the end, a limit or a signal; returns why it ended."""
        part = Part(state.step if state else 0)
        self.saved = state.step if state else None
        try:
            with _signals(self):
                for frame in simulate(self.problem, state, on_step=self.after_step):
                    self.show(frame)
            self.save()
            why = FINISHED
        except _Stop as stop:
            self.show_last()
            why = str(stop)
        except (Unstable, OutOfRange, TooLarge) as e:
            self.show_last()
            self.end(part, f"{type(e).__name__}: {e}")
            raise
        self.end(part, why)
        return why

    def after_step(self, state, dt):
        """After every step; a frame that is due comes first."""
        self.state, self.dt = state, dt
        self.watch.step(state, dt)
        if not frame_is_due(self.problem.clock, state):
            self.rest()

    def show(self, frame):
        """Store a frame of the run."""
        self.state, self.shown = frame.state, frame.state.step
        now = energy(frame.state.bodies, self.problem.gravity, self.problem.inertia)
        self.writer.append(frame, now)
        self.watch.frame(frame, now)
        self.rest()

    def rest(self):
        """Save a checkpoint and stop, where it is time."""
        stop = self.why_stop()
        if stop or self.is_due():
            self.save()
        if stop and not ended(self.problem.clock, self.state):
            raise _Stop(stop)

    def why_stop(self):
        """Why to stop here, or None."""
        if self.asked is not None:
            return SIGNALS[self.asked]
        limit = self.options.steps
        return AT_LIMIT if limit is not None and self.state.step >= limit else None

    def is_due(self):
        """Whether a checkpoint is due."""
        every = self.options.checkpoint_every
        if self.saved is None:
            return True
        if every is not None:
            return self.state.step % every == 0
        return time.perf_counter() - self.saved_at > SECONDS

    def save(self):
        """Save a checkpoint of a state that passes all checks."""
        if self.saved == self.state.step:
            return
        check(self.problem, self.state, self.dt)
        checkpoint.save(checkpoint_of(self.out), self.state, self.problem)
        self.saved, self.saved_at = self.state.step, time.perf_counter()

    def show_last(self):
        """Store the state a run was stopped at as a frame, which a resumed run drops again."""
        if self.shown != self.state.step:
            now = energy(self.state.bodies, self.problem.gravity, self.problem.inertia)
            self.writer.append(Frame(self.state.frame, self.state.t, self.dt, self.state), now)

    def end(self, part, why):
        """Enter this part of the run in the manifest."""
        facts = self.writer.manifest
        facts["parts"].append(part.ended(why, self.state, checkpoint.digest(self.state)))
        self.writer.put_manifest(facts)


@contextmanager
def _signals(session):
    """While the block runs, the first signal asks the session to stop; a second one interrupts."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def ask(number, _):
        if session.asked is not None:
            raise KeyboardInterrupt
        session.asked = number

    before = {number: signal.signal(number, ask) for number in SIGNALS}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
