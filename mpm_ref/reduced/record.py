"""A reduced run into a results file, as full-order runs have them (see `store`), and beside the
particles what is known of each state: the group `reduced`, a row for each frame.
"""

import json
from contextlib import contextmanager
from dataclasses import dataclass, replace
from math import inf
from pathlib import Path
from typing import NamedTuple

from ..energy import energy
from ..monitor import Unstable, check
from ..rom.step import BREAKDOWNS
from ..simulate import Frame, State
from ..store import Fields, checkpoint, create
from ..store.manifest import Part, manifest
from ..store.results import Results
from ..store.running import Refused
from ..store.session import FINISHED, INTERRUPTED, checkpoint_of
from ..store.words import counted
from .field import Field
from .watch import Nonsense, Watch, watched

VECTORS = {"xhat": "1", "vhat": "1/s"}                          # of the group `reduced`: units
COUNTS = {"samples": "1", "points": "1", "rank": "1", "lost": "1"}
NUMBERS = {"residual": "m/s", "beyond": "1", "off": "1", "seen": "1"}
BROKEN = (*BREAKDOWNS, Unstable)


class Lost(RuntimeError):
    """A reduced run that gives no body any more, or an impossible one."""


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


class Step(NamedTuple):
    """A state of a reduced run; no `Report` at the start."""

    state: State
    latent: object
    report: object
    sight: object           # `watch.Sight`


def require_leave(out, overwrite):
    """Raise `Refused` where a file stands that is not to be replaced, and BadResults for one that
    is no results file.
    """
    if not Path(out).exists():
        return
    with Results(out) as results:
        if overwrite:
            return
        if cut_off(results.manifest):
            raise Refused(f"{out} holds a reduced run that was cut off after "
                          f"{counted(len(results), 'frame')}; such runs take seconds and do not go "
                          "on: make it again with --overwrite")
        raise Refused(f"{out} exists: add --overwrite to replace it, or name another file")


def cut_off(facts):
    """Whether a manifest is that of a reduced run that was interrupted or killed."""
    parts = facts.get("parts")
    return "reduced" in facts and (not parts or parts[-1]["why"] == INTERRUPTED)


def record(recording, out, on_step=None):
    """Make a reduced run into the results file `out`; returns {step: `Sight`} of those out of
    bounds (see `watch`).

    on_step(k) is called after each step. Raises `Lost` where the run breaks down; the frames before
    then stand. Raises `NotWritten` or `InUse`.
    """
    problem = recording.problem
    facts = manifest(problem, recording.run.seed) | {"reduced": recording.facts}
    marked = replace(problem, source=json.dumps([recording.facts, problem.source]))
    writer, out_of_bounds = create(out, marked, Fields(), facts, checkpoint_of(out)), {}
    try:
        series = _lay_out(writer.h5, recording.model.decoder.r)
        with _part(writer) as part:
            for step in steps(recording):
                _append(series, step)
                _show(writer, step.state, problem)
                part.state, k = step.state, step.state.step
                if step.sight.why:
                    out_of_bounds[k] = step.sight
                if on_step is not None:
                    on_step(k)
    finally:
        writer.close()
    return out_of_bounds


def steps(recording):
    """Yield each `Step` of a run, the start first; raises `Lost`. Inverted points are for `watch`
    to judge: among very many, a few may be.
    """
    problem, run, k = recording.problem, recording.run, 0
    bounds = replace(problem, limits=replace(problem.limits, J=(-inf, inf)))
    found = watched(recording.watch, recording.case, run.way, recording.model.rest, run.seed)
    try:
        for latent, report, sight in found:
            body = recording.field.at(latent, problem.clock.dt, run.velocity)
            state = State((body,), step=k, t=k * problem.clock.dt, frame=k + 1)
            check(bounds, state, problem.clock.dt if k else 0.0)
            yield Step(state, latent, report, sight)
            k += 1
    except Nonsense as fault:
        raise Lost(str(fault)) from fault
    except BROKEN as fault:
        raise Lost(f"the reduced run broke down in step {k}: {getattr(fault, 'reason', fault)}; "
                   "are the parameters within the studied range, are there enough samples, and is "
                   "the map good (mpm-ref rom evaluate)?") from fault


def _show(writer, state, problem):
    """Append a state as a frame."""
    dt = problem.clock.dt if state.step else 0.0
    writer.append(Frame(state.step, state.t, dt, state), energy(state.bodies, problem.gravity))


class _Part(Part):
    """A part of a run, with its last state."""

    state = None


@contextmanager
def _part(writer):
    """Enter a run in the manifest, however it ends."""
    part, why = _Part(0), FINISHED
    try:
        yield part
    except KeyboardInterrupt:
        why = INTERRUPTED
        raise
    except Lost as fault:
        why = str(fault)
        raise
    finally:
        if part.state is not None:
            facts = writer.manifest
            facts["parts"].append(part.ended(why, part.state, checkpoint.digest(part.state)))
            writer.put_manifest(facts)


def _lay_out(h5, r):
    """The empty series of the group `reduced`, by name."""
    group, series = h5.create_group("reduced"), {}
    kinds = ((VECTORS, (r,), "f8"), (COUNTS, (), "i8"), (NUMBERS, (), "f8"))
    for names, shape, kind in kinds:
        for name, unit in names.items():
            series[name] = group.create_dataset(name, (0, *shape), kind, maxshape=(None, *shape),
                                                chunks=(64, *shape), fletcher32=True)
            series[name].attrs["unit"] = unit
    return series


def _append(series, step):
    """A row of each series; zeros for what a step reports before the first. They stand with the
    frame's commit.
    """
    rows = {**step.latent._asdict(), **step.sight._asdict()}
    if step.report is not None:
        rows |= {**step.report._asdict(), "lost": step.report.quadrature.get("lost", 0)}
    else:
        rows["lost"] = 0
    for name, dataset in series.items():
        dataset.resize(len(dataset) + 1, axis=0)
        dataset[-1] = rows.get(name, 0)
