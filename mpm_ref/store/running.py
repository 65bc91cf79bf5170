"""Run a problem into a results file, to be continued bit for bit after whatever ended it.

`run(problem, "out.h5")` is the whole interface; a `Session` stores frames and checkpoints while
the run goes on.
"""

import signal
import threading
import time
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path

from ..energy import energy
from ..monitor import Unstable, check
from ..nclaw.strain_watch import strain_watch
from ..simulate import Frame, ended, frame_is_due, simulate, start
from ..timestep import TooLarge
from . import checkpoint
from .atomic import require_place
from .manifest import Part, manifest, unsolved
from .results import BadResults, Results
from .writer import Fields, create, reopen, require_run


class Refused(ValueError):
    """A run that was asked for would destroy, cannot find, or does not fit an earlier one."""


@dataclass(frozen=True)
class Options:
    """How a run is recorded.

    steps: stop after this many steps in all, to be continued later; checkpoint_every: steps between
    checkpoints, None for one a minute; fields: what is stored (`Fields`), None for the usual, or
    what a resumed run began with, and nothing else is taken for that; resume: go on from the
    checkpoint beside the results, or begin where there is none; overwrite: replace the results of
    an earlier run; seed: of the scene, for the manifest; facts: what else that is to say, plain
    values by name.
    """

    steps: int | None = None
    checkpoint_every: int | None = None
    fields: Fields | None = None
    resume: bool = False
    overwrite: bool = False
    seed: int | None = None
    facts: dict = field(default_factory=dict)

    def __post_init__(self):
        for name in ("steps", "checkpoint_every"):
            if getattr(self, name) is not None and getattr(self, name) < 1:
                raise ValueError(f"{name} = {getattr(self, name)}: expected a number of steps >= 1")
        if self.resume and self.overwrite:
            raise ValueError("resume and overwrite: give at most one of the two")


@dataclass(frozen=True)
class Outcome:
    """How a run ended: why ("finished", "step limit", "interrupted", "terminated"), the `State` it
    ended with, frames stored, whether it went on with the very code that began it, and how many
    implicit steps of all its parts were not solved, which unstable = "allow" lets pass.
    """

    why: str
    state: object
    frames: int
    same_code: bool
    unsolved: int


def run(problem, out, options=None, watch=None):
    """Run a `Problem` into the results file `out`, and return an `Outcome`.

    SIGINT and SIGTERM end the run after the step being made, with a checkpoint. A run that becomes
    unstable raises `Unstable` or `TooLarge`; the last checkpoint, of a state that
    passed all checks, then stands. One that cannot even begin raises them, or `OutOfRange`, before
    anything is written. Raises `Refused`, `BadCheckpoint`, `BadResults`, `InUse`
    or `NotWritten` where files stand in the way. The arrays of the problem's bodies are changed.
    """
    options, watch = options or Options(), watch or Watch()
    require_place(out)
    state, same_code = _where_to_begin(problem, out, options)
    _require_same_fields(problem, out, options)
    over = _why_over(problem, state, options)
    if over is not None:
        return _as_it_stands(problem, out, Outcome(over, state, 0, same_code, 0))
    writer = _open(problem, out, options, state)
    try:
        session = Session(problem, writer, watch, options.steps, options.checkpoint_every)
        watch.begin(problem, state)
        why = session.loop(state)
        return Outcome(why, session.state, len(writer), same_code, unsolved(writer.manifest))
    finally:
        writer.close()


def _where_to_begin(problem, out, options):
    """Return (state of the checkpoint, or the first one, whether this very code saved it)."""
    path = checkpoint_of(out)
    _require_leave(out, options)
    if Path(out).exists():
        _require_results(out, options)
    if options.resume and path.exists():
        if not Path(out).exists():
            raise Refused(f"{out}: there are no results beside the checkpoint {path}; "
                          "put them back, or remove the checkpoint to begin anew")
        return checkpoint.load(path, problem)
    return start(problem, problem.stepper()), True


def _require_leave(out, options):
    """Raise `Refused` where results stand that are neither to be continued nor replaced."""
    if Path(out).exists() and not (options.resume or options.overwrite):
        raise Refused(f"{out} exists: add --resume to continue it, --overwrite to replace it, "
                      "or name another file")


def _require_results(out, options):
    """Raise `Refused` or `BadResults` for a file that no run wrote: what it holds would be lost."""
    try:
        Results(out).close()
    except BadResults as fault:
        if options.resume:
            raise
        raise Refused(f"{out} is not a results file, or not a whole one, and only those are "
                      "overwritten; remove it yourself, or name another file") from fault


def _require_same_fields(problem, out, options):
    """Raise `Refused` if a run that goes on is to store something else than it began with."""
    if not options.resume or options.fields is None or not Path(out).exists():
        return
    with Results(out) as results:
        for body in problem.bodies:
            if body.name not in results.bodies:
                return                  # of another scene, which `reopen` refuses
            stored, gzip = results.fields(body.name), results.gzip(body.name)
            asked = list(options.fields.of(body))
            if set(asked) != set(stored) or options.fields.gzip != gzip:
                raise Refused(
                    f"{out} was begun with the fields {','.join(stored)} and gzip {gzip}, not with "
                    f"{','.join(asked)} and gzip {options.fields.gzip}: leave fields and gzip out "
                    "to continue it, or write to another file")


def _why_over(problem, state, options):
    """Return why a state needs no further step, or None."""
    if ended(problem.clock, state):
        return FINISHED
    return AT_LIMIT if options.steps is not None and state.step >= options.steps else None


def _as_it_stands(problem, out, outcome):
    """The `Outcome` of a run that needs no further step, with what its results hold."""
    with Results(out) as results:
        require_run(results.h5, out, problem, outcome.state.frame)
        return replace(outcome, frames=len(results), unsolved=unsolved(results.manifest))


def _open(problem, out, options, state):
    """`Writer` of the results, new ones or those of the run that goes on."""
    if options.resume and Path(out).exists():
        return reopen(out, problem, state.frame)
    _require_leave(out, options)        # another run may have begun there meanwhile
    facts = manifest(problem, options.seed) | options.facts
    return create(out, problem, options.fields or Fields(), facts, beside=checkpoint_of(out))


SECONDS = 60.0     # between checkpoints, unless a number of steps is given
FINISHED, AT_LIMIT, INTERRUPTED, TERMINATED = "finished", "step limit", "interrupted", "terminated"
SIGNALS = {signal.SIGINT: INTERRUPTED, signal.SIGTERM: TERMINATED}


class Watch:
    """What a run tells while it goes on; this one does not listen."""

    def begin(self, problem, state):
        """A run begins, or goes on from a state that has frames already."""

    def step(self, state, dt):
        """A step of length dt [s] was made."""

    def frame(self, frame, energy):
        """A frame was stored."""

    def astray(self, said):
        """A learned law is asked what it has not seen, in a sentence (see `nclaw.strain_watch`)."""


class _Stop(Exception):
    """Raised between two steps, by the session itself."""


def checkpoint_of(out):
    """Path of the checkpoint that belongs to a results file: run.h5 -> run.checkpoint.h5."""
    return Path(out).with_suffix(checkpoint.SUFFIX)


class Session:
    """Runs a problem into a `Writer` until it ends, or until a step limit or a signal.

    steps and every are `Options.steps` and `Options.checkpoint_every`.
    """

    def __init__(self, problem, writer, watch, steps=None, every=None):
        self.problem, self.writer, self.watch = problem, writer, watch
        self.steps, self.every = steps, every
        self.state, self.part, self.dt, self.asked = None, None, 0.0, None
        self.shown = self.saved = None        # steps at which a frame, a checkpoint was last stored
        self.saved_at = time.perf_counter()
        self.range = strain_watch(problem)

    def loop(self, state):
        """Run from a state; returns why it ended, see `Outcome`."""
        self.part = Part(state.step)
        self.state, self.shown = state, self.writer.last_step
        self.saved = state.step if state.frame else None
        try:
            with _signals(self):
                for frame in simulate(self.problem, state, on_step=self.after_step):
                    self.show(frame)
            self.save()
            why = FINISHED
        except _Stop as stop:
            self.show_last()
            why = str(stop)
        except (Unstable, TooLarge) as fault:
            self.show_last()
            self.end(f"{type(fault).__name__}: {fault}")
            raise
        self.end(why)
        return why

    def after_step(self, state, dt):
        """After every step; a frame that is due comes first."""
        self.state, self.dt = state, dt
        self.part.unsolved += state.solve is not None and not state.solve.converged
        self.watch.step(state, dt)
        if self.range is not None:
            self.tell(self.range.news(state))
        if not frame_is_due(self.problem.clock, state):
            self.rest()

    def tell(self, sentences):
        """Enter sentences about learned laws in this part of the run, and pass them on."""
        self.part.astray += sentences
        for said in sentences:
            self.watch.astray(said)

    def show(self, frame):
        """Store a frame of the run."""
        self.state, self.shown = frame.state, frame.state.step
        self.watch.frame(frame, self.store(frame))
        self.rest()

    def show_last(self):
        """Store the state at which a run broke off as a frame; a resumed run drops it again."""
        if self.shown != self.state.step:
            self.store(Frame(self.state.frame, self.state.t, self.dt, self.state))

    def store(self, frame):
        """Append a frame to the results; returns its `Energy`."""
        now = energy(frame.state.bodies, self.problem.gravity, self.problem.inertia)
        self.writer.append(frame, now)
        return now

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
        return AT_LIMIT if self.steps is not None and self.state.step >= self.steps else None

    def is_due(self):
        """Whether a checkpoint is due; the first one after the first frame."""
        if self.saved is None:
            return True
        if self.every is not None:
            return self.state.step % self.every == 0
        return time.perf_counter() - self.saved_at > SECONDS

    def save(self):
        """Save a checkpoint, of a state that passes all checks; of another, the loop will judge at
        its own time. Raises `NotWritten`.
        """
        if self.saved == self.state.step:
            return
        try:
            check(self.problem, self.state, self.dt)
        except Unstable:
            return
        checkpoint.save(checkpoint_of(self.writer.path), self.state, self.problem)
        self.saved, self.saved_at = self.state.step, time.perf_counter()

    def end(self, why):
        """Enter this part of the run in the manifest."""
        facts = self.writer.manifest
        facts["parts"].append(self.part.ended(why, self.state, checkpoint.digest(self.state)))
        self.writer.put_manifest(facts)


@contextmanager
def _signals(session):
    """While the block runs, the first signal asks the session to stop; a second one interrupts."""
    if threading.current_thread() is not threading.main_thread():
        yield            # only the main thread is told of signals
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
