"""Run a problem into a results file; an interrupted run can resume bit for bit.

`run(problem, "out.h5")` is the interface; a `Session` stores frames and checkpoints meanwhile.
"""

import signal
import threading
import time
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path

from ..energy import energy
from ..indicators import IndicatorWatch
from ..monitor import Unstable, check
from ..nclaw.strain_watch import strain_watch
from ..simulate import Frame, ended, frame_is_due, simulate, start
from ..timestep import TooLarge
from . import checkpoint
from .atomic import require_place
from .manifest import RunPart, count_unsolved, manifest
from .results import BadResults, Results
from .writer import StoredFields, create, reopen, require_run


class Refused(ValueError):
    """A run would overwrite an earlier one, does not fit it, or cannot find it."""


@dataclass(frozen=True)
class Options:
    """Options of recording a run.

    steps: stop after this many steps in all, to be resumed later; checkpoint_every: steps between
    checkpoints (default: one a minute); fields: the `StoredFields`, by default the usual ones, or
    for a resumed run those that it began with, which cannot change; resume: resume from the
    checkpoint of the results file, or begin if there is none; overwrite: replace the results of an
    earlier run; seed: seed of the scene, for the manifest; facts: further entries of the manifest,
    plain values by name.
    """

    steps: int | None = None
    checkpoint_every: int | None = None
    fields: StoredFields | None = None
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
class RunOutcome:
    """The end of a run.

    why: "finished", "step limit", "interrupted" or "terminated"; state: the last `State`; frames:
    number of stored frames; same_code: whether the code that began the run also ended it; unsolved:
    number of implicit steps of all parts that did not converge, which unstable = "allow" accepts.
    """

    why: str
    state: object
    frames: int
    same_code: bool
    unsolved: int


def run(problem, out, options=None, watch=None):
    """Run a `Problem` into the results file `out`, and return a `RunOutcome`.

    SIGINT and SIGTERM end the run after the current step, with a checkpoint. A run that becomes
    unstable raises `Unstable` or `TooLarge` and leaves the last checkpoint, of a state that passed
    all checks. A run that cannot begin raises them, or `OutOfRange`, before anything is written.
    Raises `Refused`, `BadCheckpoint`, `BadResults`, `InUse` or `NotWritten` if existing files do
    not fit or cannot be written. The arrays of the problem's bodies are changed.
    """
    options, watch = options or Options(), watch or Watch()
    require_place(out)
    state, same_code = _first_state(problem, out, options)
    _require_same_fields(problem, out, options)
    complete = _why_complete(problem, state, options)
    if complete is not None:
        return _stored_outcome(problem, out, RunOutcome(complete, state, 0, same_code, 0))
    writer = _open(problem, out, options, state)
    try:
        session = Session(problem, writer, watch, options.steps, options.checkpoint_every)
        watch.begin(problem, state)
        why = session.loop(state)
        return RunOutcome(why, session.state, len(writer), same_code,
                          count_unsolved(writer.manifest))
    finally:
        writer.close()


def _first_state(problem, out, options):
    """Return the state of the checkpoint, or the first one, and whether the same code saved it."""
    path = checkpoint_of(out)
    _require_permission(out, options)
    if Path(out).exists():
        _require_results(out, options)
    if options.resume and path.exists():
        if not Path(out).exists():
            raise Refused(f"{out}: there are no results beside the checkpoint {path}; "
                          "put them back, or remove the checkpoint to begin anew")
        return checkpoint.load(path, problem)
    return start(problem, problem.stepper()), True


def _require_permission(out, options):
    """Raise `Refused` if results exist that are neither to be resumed nor replaced."""
    if Path(out).exists() and not (options.resume or options.overwrite):
        raise Refused(f"{out} exists: add --resume to continue it, --overwrite to replace it, "
                      "or name another file")


def _require_results(out, options):
    """Raise `Refused` or `BadResults` for a file that no run wrote, which would be lost."""
    try:
        Results(out).close()
    except BadResults as fault:
        if options.resume:
            raise
        raise Refused(f"{out} is not a results file, or not a whole one, and only those are "
                      "overwritten; remove it yourself, or name another file") from fault


def _require_same_fields(problem, out, options):
    """Raise `Refused` if a resumed run would store other fields than it began with."""
    if not options.resume or options.fields is None or not Path(out).exists():
        return
    with Results(out) as results:
        for body in problem.bodies:
            if body.name not in results.bodies:
                return                  # of another scene, which `reopen` refuses
            stored, gzip = results.fields(body.name), results.gzip(body.name)
            asked = list(options.fields.select(body))
            if set(asked) != set(stored) or options.fields.gzip != gzip:
                raise Refused(
                    f"{out} was begun with the fields {','.join(stored)} and gzip {gzip}, not with "
                    f"{','.join(asked)} and gzip {options.fields.gzip}: leave fields and gzip out "
                    "to continue it, or write to another file")


def _why_complete(problem, state, options):
    """Return why a state needs no further step, or None."""
    if ended(problem.clock, state):
        return FINISHED
    return AT_LIMIT if options.steps is not None and state.step >= options.steps else None


def _stored_outcome(problem, out, outcome):
    """Return the `RunOutcome` of a run that needs no further step, from its results file."""
    with Results(out) as results:
        require_run(results.h5, out, problem, outcome.state.frame)
        return replace(outcome, frames=len(results), unsolved=count_unsolved(results.manifest))


def _open(problem, out, options, state):
    """Return the `Writer` of new results, or of those of the run that resumes."""
    if options.resume and Path(out).exists():
        return reopen(out, problem, state.frame)
    _require_permission(out, options)        # another run may have begun there meanwhile
    facts = manifest(problem, options.seed) | options.facts
    return create(out, problem, options.fields or StoredFields(), facts, checkpoint_of(out))


SECONDS = 60.0     # between checkpoints, unless a number of steps is given
FINISHED, AT_LIMIT, INTERRUPTED, TERMINATED = "finished", "step limit", "interrupted", "terminated"
SIGNALS = {signal.SIGINT: INTERRUPTED, signal.SIGTERM: TERMINATED}


class Watch:
    """A listener that a run calls while it proceeds; the methods of this one do nothing."""

    def begin(self, problem, state):
        """Note that a run begins at `state`, or resumes if the state already has frames."""

    def step(self, state, dt):
        """Note that a step of length dt [s] ended in `state`."""

    def frame(self, frame, energy):
        """Note that a frame with its energy was stored."""

    def warn(self, message):
        """Note a warning that strains exceed the training of a law (see `nclaw.strain_watch`), or
        of an error that the run shows (see `indicators`).
        """


class _Stop(Exception):
    """Raised between two steps, by the session itself."""


def checkpoint_of(out):
    """Return the path of the checkpoint of a results file: run.h5 -> run.checkpoint.h5."""
    return Path(out).with_suffix(checkpoint.SUFFIX)


class Session:
    """A run into a `Writer`, until it ends or meets a step limit or a signal.

    steps and every are `Options.steps` and `Options.checkpoint_every`.
    """

    def __init__(self, problem, writer, watch, steps=None, every=None):
        self.problem, self.writer, self.watch = problem, writer, watch
        self.steps, self.every = steps, every
        self.state, self.part, self.dt, self.asked = None, None, 0.0, None
        self.shown = self.saved = None        # steps at which a frame, a checkpoint was last stored
        self.saved_at = time.perf_counter()
        self.range, self.indicators = strain_watch(problem), IndicatorWatch(problem)

    def loop(self, state):
        """Run from a state and return why the run ended (see `RunOutcome`)."""
        self.part = RunPart(state.step)
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
        """Report a step; save and stop if it is time, unless a frame of this state follows."""
        self.state, self.dt = state, dt
        self.part.unsolved += state.solve is not None and not state.solve.converged
        self.watch.step(state, dt)
        self.warn(self.indicators.news(state, dt), self.part.error_warnings)
        if self.range is not None:
            self.range.count(state)
            self.warn(self.range.news(state), self.part.strain_warnings)
        if not frame_is_due(self.problem.clock, state):
            self.save_or_stop()

    def warn(self, sentences, warnings):
        """Add sentences to the warnings of this part of the run, and pass them to the watch."""
        warnings += sentences
        for message in sentences:
            self.watch.warn(message)

    def show(self, frame):
        """Store a regular frame of the run."""
        self.state, self.shown = frame.state, frame.state.step
        self.watch.frame(frame, self.store(frame))
        self.save_or_stop()

    def show_last(self):
        """Store the state at which a run broke off as a frame, which a resumed run drops."""
        if self.shown != self.state.step:
            self.store(Frame(self.state.frame, self.state.t, self.dt, self.state))

    def store(self, frame):
        """Append a frame to the results and return its `Energy`."""
        now = energy(frame.state.bodies, self.problem.gravity, self.problem.inertia)
        self.writer.append(frame, now)
        return now

    def save_or_stop(self):
        """Save a checkpoint and stop the run, if it is time."""
        stop = self.why_stop()
        if stop or self.is_due():
            self.save()
        if stop and not ended(self.problem.clock, self.state):
            raise _Stop(stop)

    def why_stop(self):
        """Return the reason to stop after this step, or None."""
        if self.asked is not None:
            return SIGNALS[self.asked]
        return AT_LIMIT if self.steps is not None and self.state.step >= self.steps else None

    def is_due(self):
        """Return whether a checkpoint is due; the first one follows the first frame."""
        if self.saved is None:
            return True
        if self.every is not None:
            return self.state.step % self.every == 0
        return time.perf_counter() - self.saved_at > SECONDS

    def save(self):
        """Save a checkpoint if the state passes all checks; the loop handles one that does not.

        Raises `NotWritten`.
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
        """Add this part of the run to the manifest."""
        if self.range is not None:
            self.part.cut_particle_steps = self.range.cut
            self.warn(self.range.summary(), self.part.strain_warnings)
        if self.problem.budget is not None:
            self.part.energy_budget = self.problem.budget.facts()
        facts = self.writer.manifest
        facts["parts"].append(self.part.ended(why, self.state, checkpoint.digest(self.state)))
        self.writer.put_manifest(facts)


@contextmanager
def _signals(session):
    """While the block runs, the first signal asks the session to stop; a second one interrupts."""
    if threading.current_thread() is not threading.main_thread():
        yield            # only the main thread receives signals
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
