"""One part of a run on files: whenever the state stands whole between two steps, it decides whether
to store a frame, to save a checkpoint, and to stop.
"""

import signal
import threading
import time
from contextlib import contextmanager
from pathlib import Path

from ..energy import energy
from ..monitor import Unstable, check
from ..nclaw.strain_watch import watch as range_watch
from ..simulate import Frame, ended, frame_is_due, simulate
from ..timestep import TooLarge
from . import checkpoint
from .manifest import Part

SECONDS = 60.0     # between checkpoints, unless a number of steps is given
FINISHED, AT_LIMIT, INTERRUPTED, TERMINATED = "finished", "step limit", "interrupted", "terminated"
SIGNALS = {signal.SIGINT: INTERRUPTED, signal.SIGTERM: TERMINATED}


class Watch:
    """What a run tells while it goes on; this one does not listen."""

    def begin(self, problem, state):
        """A run begins, or goes on from a state (None: from its start)."""

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
        self.range = range_watch(problem)

    def loop(self, state):
        """Run from a state, or None for the start; returns why it ended, see `Outcome`."""
        self.part = Part(state.step if state else 0)
        self.state, self.shown = state, self.writer.last_step
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
