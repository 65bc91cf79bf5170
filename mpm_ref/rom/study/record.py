"""A reduced run as a results file, as full-order runs have them (see `store`); beside the particles
the group `reduced` has a row for each frame: latent coordinates, the step's report, and the check
of the state.
"""

import json
from contextlib import contextmanager
from dataclasses import dataclass, replace
from math import inf
from typing import NamedTuple

import msgspec
import numpy as np

from ...energy import energy
from ...monitor import Unstable, check
from ...simulate import Frame, State
from ...store import checkpoint
from ...store.manifest import RunPart, manifest
from ...store.running import FINISHED, INTERRUPTED, checkpoint_of
from ...store.writer import StoredFields, create, reopen
from ..integrity import DamagedModel
from ..step import BREAKDOWNS
from .monitor import NoBodyLeft, StateCheck, checked_states, stored_check
from .run import ReducedRun

BROKEN = (*BREAKDOWNS, Unstable)
UNENDED = "not ended"       # of a part of a run that goes on, or was killed


class RunSeries(NamedTuple):
    """The series of the group `reduced`: {name: unit} of vectors (r,), counts and numbers."""

    vectors: dict
    counts: dict
    numbers: dict


LDM_SERIES = RunSeries(
    {"xhat": "1", "vhat": "1/s"}, {"samples": "1", "points": "1", "rank": "1", "lost": "1"},
    {"residual": "m/s", "beyond": "1", "off": "1", "coverage": "1", "inverted": "1",
     "departure": "1"})
NSF_SERIES = RunSeries({"xhat": "1"}, {"samples": "1", "points": "1", "rank": "1"},
                    {"residual": "m", "beyond": "1", "departure": "1"})


class BrokenRun(RuntimeError):
    """A reduced run that gives no body any more, or an impossible one, in a step."""

    def __init__(self, message, step):
        super().__init__(message)
        self.step = step


@dataclass(frozen=True)
class Recording:
    """A reduced run to be recorded."""

    run: ReducedRun
    monitor: object         # of `monitor`
    display: object         # of `display`: the bodies of a state
    problem: object         # of the points shown: its source, limits, and the clock of the run
    options: object         # [run] of the study
    facts: dict             # plain values that describe the run
    series: RunSeries
    fields: StoredFields          # of particles, stored in each frame
    warnings: tuple = ()    # before the run

    @property
    def r(self):
        """Number of latent coordinates."""
        return self.run.stepper.field.r

    @property
    def count(self):
        """Number of points shown."""
        return self.display.count


class RecordedRun(NamedTuple):
    """The end of a reduced run, and its states that were out of bounds."""

    out_of_bounds: dict     # {step: `StateCheck`}
    breakdown: object       # the `BrokenRun` with which it ended early, or None


class ShownState(NamedTuple):
    """A state of a reduced run, and its bodies; None of a state that is recorded already."""

    reduced: object         # `RunState`
    check: StateCheck
    shown: State | None


def recording(study, model, mu, count=None):
    """Return the `Recording` of a study's reduced run with parameters mu, shown at `count` points
    of the body's shape; None: at those of the study. Raises ValueError for samples that do not
    suffice, a precision that the map has not, a number of points for fields that are known at their
    own alone, and a scene that reduced runs do not support.
    """
    full = supported_model(study, mu)
    facts = {"study": study.digest, "name": study.path.stem, "map": model.about["map"],
             "points": len(full.X),
             "parameters": dict(zip(study.names, map(float, mu), strict=True)),
             "run": msgspec.to_builtins(study.tables.run), **study.model_entry}
    field = study.method.field_of_run(model.field, full, mu)
    return study.method.recording(study, full, field, model, facts, count)


def supported_model(study, mu):
    """Return the `FullModel` of a study's run with parameters mu. Raises ValueError for a scene
    that reduced runs do not support, and for options that do not suit it: with NSF samples that do
    not suffice, with LDM a map or a quadrature of a single body for several.
    """
    full = study.method.full_model(study.scene(mu))
    study.method.require_options(study, full)
    return full


def particle_bytes(study, mu, count=None):
    """Return the bytes of the particles in the results file of a reduced run with parameters mu,
    shown at `count` points; None: those of the study. Raises ValueError as `supported_model` does.
    """
    full = supported_model(study, mu)
    steps = round(full.problem.clock.steps / getattr(study.tables.run, "dt_factor", 1.0))
    fields = study.method.shown_fields.select(full.problem.bodies[0])
    point = sum(a[0].nbytes for a in fields.values())
    return (steps + 1) * (count or len(full.X)) * point


def record(recording, out, earlier=(), on_step=None):
    """Run a reduced run into the results file `out`; return a `RecordedRun`. earlier: its states
    that the file has, after which it goes on (see `resume`).

    on_step(k) is called after each step. Where the run breaks down, the frames before then stand.
    Raises `NotWritten` or `InUse`.
    """
    writer, out_of_bounds, breakdown = _writer(recording, out, len(earlier)), {}, None
    try:
        with _part(writer, max(len(earlier) - 1, 0)) as part:
            for k, state in enumerate(shown_states(recording, earlier)):
                if state.shown is not None:
                    _append(writer.h5["reduced"], row_of(state))
                    _show(writer, state.shown, recording.problem)
                    part.state = state.shown
                if state.check.out_of_bounds:
                    out_of_bounds[k] = state.check
                if on_step is not None:
                    on_step(k)
    except BrokenRun as fault:
        breakdown = fault
    finally:
        writer.close()
    return RecordedRun(out_of_bounds, breakdown)


def marked_problem(recording):
    """Return the problem whose source says that it is a reduced run, and which."""
    problem = recording.problem
    return replace(problem, source=json.dumps([recording.facts, problem.source]))


def _writer(recording, out, frames):
    """Return the `Writer` of a new file, or of one that has this number of frames."""
    if frames:
        writer = reopen(out, marked_problem(recording), frames)
        _cut(writer, frames)
        return writer
    facts = manifest(recording.problem, recording.options.seed) | {"reduced": recording.facts}
    writer = create(out, marked_problem(recording), recording.fields, facts, checkpoint_of(out))
    _lay_out(writer.h5, recording.series, recording.r)
    return writer


def shown_states(recording, earlier=()):
    """Yield each `ShownState` of a run, the start first, also of its earlier states; raises
    `BrokenRun`. Inverted points are for `monitor` to judge: of very many, a few may be.
    """
    problem, k = recording.problem, 0
    dt = problem.clock.dt
    bounds = replace(problem, limits=replace(problem.limits, J=(-inf, inf)))
    try:
        for reduced, state_check in checked_states(recording.run, recording.monitor, earlier):
            state = None
            if k >= len(earlier):
                bodies = recording.display.bodies(reduced.latent, dt)
                state = State(bodies, step=k, t=k * dt, frame=k + 1)
                check(bounds, state, dt if k else 0.0)
            yield ShownState(reduced, state_check, state)
            k += 1
    except (NoBodyLeft, DamagedModel) as fault:
        raise BrokenRun(str(fault), k) from fault
    except BROKEN as fault:
        factor = getattr(recording.options, "dt_factor", 1.0)
        longer = f", and are steps {factor:g} times as long too long" if factor > 1.0 else ""
        raise BrokenRun(f"the reduced run broke down in step {k}: "
                        f"{getattr(fault, 'reason', fault)}; are the parameters within the studied "
                        "range, are there enough samples, and is the map good (mpm-ref rom "
                        f"evaluate){longer}?", k) from fault


def row_of(state):
    """Return {name of a series: value} of a `ShownState`; at the start nothing is reported."""
    reduced = state.reduced
    row = {**reduced.latent._asdict(), **state.check._asdict(), "lost": 0}
    if reduced.report is not None:
        lost = reduced.report.quadrature.get("lost", 0)
        row |= {**reduced.report._asdict(), "lost": lost}
    return row


def _show(writer, state, problem):
    """Append a state as a frame."""
    dt = problem.clock.dt if state.step else 0.0
    now = energy(state.bodies, problem.gravity, problem.inertia)
    writer.append(Frame(state.step, state.t, dt, state), now)


class _Part(RunPart):
    """A part of a run, and its last state."""

    state = None

    @property
    def open_entry(self):
        """The entry of `parts` in the manifest of a part that has not ended."""
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
    writer.put_manifest(facts | {"parts": [*before, part.open_entry]})
    try:
        yield part
        why = FINISHED
    except KeyboardInterrupt:
        why = INTERRUPTED
        raise
    except BrokenRun as fault:
        why = str(fault)
        raise
    finally:
        if why is not None:
            _cut(writer, frames if part.state is None else part.state.step + 1)
            writer.put_manifest(facts | {"parts": [*before, _entry(part, why)]})


def _entry(part, why):
    """Return the entry of a part that ended; of one without a state, without its end."""
    if part.state is None:
        return part.open_entry | {"why": why}
    return part.ended(why, part.state, checkpoint.digest(part.state))


def _lay_out(h5, series, r):
    """Create the empty series of the group `reduced`."""
    group = h5.create_group("reduced")
    for names, shape, kind in zip(series, ((r,), (), ()), ("f8", "i8", "f8"), strict=True):
        for name, unit in names.items():
            data = group.create_dataset(name, (0, *shape), kind, maxshape=(None, *shape),
                                        chunks=(64, *shape), fletcher32=True)
            data.attrs["unit"] = unit


def _cut(writer, frames):
    """Keep the first frames, and their rows of the group `reduced`."""
    for series in writer.h5["reduced"].values():
        series.resize(frames, axis=0)
    writer.truncate(frames)


def _append(series, row):
    """Append a value of each series, zero where the row has none. They stand with the frame's
    commit.
    """
    for name, dataset in series.items():
        dataset.resize(len(dataset) + 1, axis=0)
        dataset[-1] = row.get(name, 0)


def summary(results):
    """Return the summary of the reduced run in `Results`, or None of a full-order run.

    It is the entry of the manifest with the number of states, of those that were out of bounds, and
    the means of samples and of integration points over the steps.
    """
    facts = results.manifest.get("reduced")
    if facts is None or "reduced" not in results.h5:
        return None
    n = len(results)
    rows = {name: series[:n] for name, series in results.h5["reduced"].items()}
    out = sum(bool(stored_check(rows, k).out_of_bounds) for k in range(n))
    means = {f"mean_{name}": float(np.mean(rows[name][1:])) if n > 1 else None
             for name in ("samples", "points")}
    return facts | {"states": n, "out_of_bounds": out} | means


def summary_line(facts):
    """Return a `summary` as a line of text."""
    name = facts.get("name", facts["study"][:12])
    parameters = ", ".join(f"{key} = {value:g}" for key, value in facts["parameters"].items())
    step = "" if facts["mean_points"] is None else (
        f"a step has {facts['mean_samples']:.4g} samples and {facts['mean_points']:.4g} "
        "integration points on average; ")
    return (f"reduced: {name}, {facts['map']['kind']} r = {facts['map']['r']}, {parameters}; "
            f"{step}{facts['out_of_bounds']} of {facts['states']} states out of bounds")
