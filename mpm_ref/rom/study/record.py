"""A reduced run into a results file, as full-order runs have them (see `store`), and beside the
particles what is known of each state: the group `reduced`, a row for each frame.

What is recorded is any object with

    problem, facts, run             of the points shown; what is to be known of the run; its options
    r, count                        numbers of latent coordinates, and of points shown
    series, stored                  series of the group; `Fields` of particles
    doubts                          warnings before the run
    states(known)                   (latent, report, sight) of all states, as a run yields them
    bodies(latent)                  the bodies in a state
    row(step)                       {name of a series: value} of a `Step`

of which `Recording` is one, and that of `nsf.recording` another.
"""

import json
from contextlib import contextmanager
from dataclasses import dataclass, replace
from math import inf
from typing import NamedTuple

from ...energy import energy
from ...monitor import Unstable, check
from ...simulate import Frame, State
from ...store import checkpoint
from ...store.manifest import Part, manifest
from ...store.running import FINISHED, INTERRUPTED, checkpoint_of
from ...store.writer import Fields, create, reopen
from ..step import BREAKDOWNS
from .field import Field
from .run import picked
from .watch import Nonsense, Watch, watched, watched_on

VECTORS = {"xhat": "1", "vhat": "1/s"}                          # of the group `reduced`: units
COUNTS = {"samples": "1", "points": "1", "rank": "1", "lost": "1"}
NUMBERS = {"residual": "m/s", "beyond": "1", "off": "1", "seen": "1", "inverted": "1"}
BROKEN = (*BREAKDOWNS, Unstable)
UNENDED = "not ended"       # of a part of a run that goes on, or was killed


class Lost(RuntimeError):
    """A reduced run that gives no body any more, or an impossible one, in a step."""

    def __init__(self, said, step):
        super().__init__(said)
        self.step = step


@dataclass(frozen=True)
class Recording:
    """A reduced run to be recorded."""

    case: object            # `Case`
    model: object           # `Model`, of a map
    run: object             # `tables.Run`
    watch: Watch            # what its states are looked at with
    field: Field            # where it is shown
    problem: object         # of these points: its source, clock and limits
    facts: dict             # what else is to be known of it, plain values

    series = VECTORS, COUNTS, NUMBERS
    stored = Fields()
    doubts = ()

    @property
    def r(self):
        """Number of latent coordinates."""
        return self.model.field.r

    @property
    def count(self):
        """Number of points shown."""
        return len(self.field.X)

    def states(self, known):
        """Yield (`Latent`, `Report` or None, `Sight`) of each state, those known too."""
        if not known:
            return watched(self.watch, self.case, self.run.way, self.model.rest, self.run.seed)
        pick = picked(self.case, self.watch.map, self.run.way, known[0][0].xhat, self.run.seed)
        return watched_on(known, self.watch, self.case, self.run.way, pick)

    def bodies(self, latent):
        """The body in a state."""
        return (self.field.at(latent, self.problem.clock.dt, self.run.velocity),)

    def row(self, step):
        """Of a `Step`; at the start nothing is reported."""
        known = {**step.latent._asdict(), **step.sight._asdict(), "lost": 0}
        if step.report is not None:
            lost = step.report.quadrature.get("lost", 0)
            known |= {**step.report._asdict(), "lost": lost}
        return known


class Outcome(NamedTuple):
    """How a reduced run ended."""

    out_of_bounds: dict     # {step: `Sight`} of its states that were out of bounds (see `watch`)
    lost: object            # the `Lost` with which it broke down, or None


class Step(NamedTuple):
    """A state of a reduced run; no `Report` at the start, no `State` of one that is recorded."""

    state: State
    latent: object
    report: object
    sight: object           # `watch.Sight`


def record(recording, out, known=(), on_step=None):
    """Make a reduced run into the results file `out`; returns an `Outcome`. known: its states that
    stand there, after which it goes on (see `begun`).

    on_step(k) is called after each step. Where the run breaks down, the frames before then stand.
    Raises `NotWritten` or `InUse`.
    """
    writer, out_of_bounds, lost = _writer(recording, out, len(known)), {}, None
    try:
        with _part(writer, max(len(known) - 1, 0)) as part:
            for k, step in enumerate(steps(recording, known)):
                if step.state is not None:
                    _append(writer.h5["reduced"], recording.row(step))
                    _show(writer, step.state, recording.problem)
                    part.state = step.state
                if step.sight.why:
                    out_of_bounds[k] = step.sight
                if on_step is not None:
                    on_step(k)
    except Lost as fault:
        lost = fault
    finally:
        writer.close()
    return Outcome(out_of_bounds, lost)


def marked(recording):
    """The problem whose source says that it is a reduced run, and which."""
    problem = recording.problem
    return replace(problem, source=json.dumps([recording.facts, problem.source]))


def _writer(recording, out, frames):
    """`Writer` of a new file, or after so many frames of one that stands."""
    if frames:
        writer = reopen(out, marked(recording), frames)
        _cut(writer, frames)
        return writer
    facts = manifest(recording.problem, recording.run.seed) | {"reduced": recording.facts}
    writer = create(out, marked(recording), recording.stored, facts, checkpoint_of(out))
    _lay_out(writer.h5, recording.series, recording.r)
    return writer


def steps(recording, known=()):
    """Yield each `Step` of a run, the start first, also of its states that are known; raises
    `Lost`. Inverted points are for `watch` to judge: among very many, a few may be.
    """
    problem, k = recording.problem, 0
    bounds = replace(problem, limits=replace(problem.limits, J=(-inf, inf)))
    try:
        for latent, report, sight in recording.states(known):
            state = None
            if k >= len(known):
                bodies = recording.bodies(latent)
                state = State(bodies, step=k, t=k * problem.clock.dt, frame=k + 1)
                check(bounds, state, problem.clock.dt if k else 0.0)
            yield Step(state, latent, report, sight)
            k += 1
    except Nonsense as fault:
        raise Lost(str(fault), k) from fault
    except BROKEN as fault:
        faster = getattr(recording.run, "faster", 1.0)
        longer = f", and are steps {faster:g} times as long too long" if faster > 1.0 else ""
        raise Lost(f"the reduced run broke down in step {k}: {getattr(fault, 'reason', fault)}; "
                   "are the parameters within the studied range, are there enough samples, and is "
                   f"the map good (mpm-ref rom evaluate){longer}?", k) from fault


def _show(writer, state, problem):
    """Append a state as a frame."""
    dt = problem.clock.dt if state.step else 0.0
    now = energy(state.bodies, problem.gravity, problem.inertia)
    writer.append(Frame(state.step, state.t, dt, state), now)


class _Part(Part):
    """A part of a run, with its last state."""

    state = None

    @property
    def begun(self):
        """Its entry of `parts` in the manifest as long as it has not ended."""
        return {"began": self.began, "why": UNENDED, "first_step": self.first_step, **self.code}


@contextmanager
def _part(writer, first_step):
    """Enter a part of a run in the manifest as it begins, so that one that is killed leaves its
    entry; and again as it finishes, is interrupted or breaks down. A frame that was being written
    then is dropped.
    """
    part, why = _Part(first_step), None
    facts, frames = writer.manifest, len(writer)
    before = facts["parts"]
    writer.put_manifest(facts | {"parts": [*before, part.begun]})
    try:
        yield part
        why = FINISHED
    except KeyboardInterrupt:
        why = INTERRUPTED
        raise
    except Lost as fault:
        why = str(fault)
        raise
    finally:
        if why is not None:
            _cut(writer, frames if part.state is None else part.state.step + 1)
            writer.put_manifest(facts | {"parts": [*before, _entry(part, why)]})


def _entry(part, why):
    """The entry of a part that ended; of one that made no state, without where it ended."""
    if part.state is None:
        return part.begun | {"why": why}
    return part.ended(why, part.state, checkpoint.digest(part.state))


def _lay_out(h5, series, r):
    """The empty series of the group `reduced`: {name: unit} of vectors (r,), counts, numbers."""
    group = h5.create_group("reduced")
    for names, shape, kind in zip(series, ((r,), (), ()), ("f8", "i8", "f8"), strict=True):
        for name, unit in names.items():
            data = group.create_dataset(name, (0, *shape), kind, maxshape=(None, *shape),
                                        chunks=(64, *shape), fletcher32=True)
            data.attrs["unit"] = unit


def _cut(writer, frames):
    """Keep the first so many frames, and their rows of the group `reduced`."""
    for series in writer.h5["reduced"].values():
        series.resize(frames, axis=0)
    writer.truncate(frames)


def _append(series, row):
    """A value of each series; zeros for what is not known before the first step. They stand with
    the frame's commit.
    """
    for name, dataset in series.items():
        dataset.resize(len(dataset) + 1, axis=0)
        dataset[-1] = row.get(name, 0)
