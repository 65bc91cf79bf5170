"""Build the sources and sinks of a scene, and check that its other parts fit them."""

from math import inf

import numpy as np

from ..core.boundary import Prescribed
from ..core.levelset import distances
from ..core.motion import Motion, Steady
from ..shapes import Analytic, level_set
from ..shapes.inside import check_bounded, solid
from ..simulate import last_step
from ..streams import (
    EntryTimes,
    ParticleSink,
    ParticleSource,
    PlaceOfLastBlock,
    SourceSway,
    blocks_until,
)
from .messages import SceneError, errors_at


def check_streams(scene, clock):
    """Raise SceneError where a scene with sources or sinks has a part that has no form with them,
    or no particle at t = 0, or where the number of particles of its run is not known beforehand.
    """
    if not flowing(scene) and not scene.sink:
        return
    if scene.contact:
        raise SceneError("contact: expected none with sources or sinks, since a body that is empty "
                         "has no velocity field")
    neural = [k for k, body in enumerate(scene.body) if body.material.is_neural]
    if neural:
        raise SceneError(f"body[{neural[0]}].material.law: expected a law by its name with sources "
                         "or sinks")
    if all(body.source is not None and body.source.start > 0.0 for body in scene.body):
        raise SceneError("body[0].source.start: no particle is there at t = 0; expected a source "
                         "with start = 0, or a body without source")
    for k, body in flowing(scene):
        if body.source.stop is None and end_of(clock) == inf:
            raise SceneError(f"body[{k}].source.stop: this key is missing; a run of adaptive "
                             "`steps` has no end that is known, and with it no number of "
                             "particles; give `stop`, `end` or `dt`")


def end_of(clock):
    """Return the time at which a run ends [s]; infinite where it is not known beforehand."""
    if clock.end is not None and clock.dt is None:
        return clock.end
    return last_step(clock) * clock.dt if clock.dt is not None else inf


def build_sources(scene, bodies):
    """Return the `streams.ParticleSource`s of a checked scene, whose bodies are one block each."""
    found, end = [], end_of(scene.parts.clock)
    for k, record in flowing(scene):
        with errors_at(f"body[{k}].source"):
            v, length, stop = stream_of(record)
            period = length / float(np.linalg.norm(v))
            blocks = blocks_until((record.source.start, period), stop, end)
            found.append(ParticleSource(k, bodies[k], v, length, record.source.start, blocks,
                                        sway_of(record)))
    return tuple(found)


def flowing(scene):
    """Return (number, record) of the bodies that have a source."""
    return [(k, body) for k, body in enumerate(scene.body) if body.source is not None]


def stream_of(record):
    """Return velocity (d,) [m/s], length of a block [m] and end [s] of the source of a body's
    record. Raises ValueError for a shape without end.
    """
    v, stop = np.array(record.velocity.linear), record.source.stop
    length = record.source.length or length_along(solid(record.shape), v)
    return v, length, inf if stop is None else stop


def sway_of(record):
    """Return the `streams.SourceSway` of the source of a body's record; None where it stands."""
    sway = record.source.sway
    return None if sway is None else SourceSway(sway.amplitude, sway.frequency)


def held_regions(scene):
    """Return the conditions of sources that hold what is in their shape: nodes there have the
    velocity of the source until its last block has passed. The region of a source that sways is
    where the block is that entered last. Raises SceneError for a shape without distance.
    """
    regions = []
    for k, record in flowing(scene):
        if not record.source.hold:
            continue
        if not isinstance(record.shape, Analytic):
            raise SceneError(f"body[{k}].source.hold = true: expected an analytic shape, whose "
                             "nodes it holds, or hold = false")
        with errors_at(f"body[{k}].source"):
            until, (v, *_) = time_of_leaving(record), stream_of(record)
            regions.append(Prescribed(level_set(record.shape), Motion(Steady(v)), follows=False,
                                      since=record.source.start, until=until,
                                      place=region_place(record)))
    return tuple(regions)


def region_place(record):
    """Return the `core.motion.Motion` of the shape of a source that sways; None where it stands.

    It jumps from block to block, so that each is held until it has left its shape, if blocks are
    as long as the shape or longer.
    """
    sway = sway_of(record)
    if sway is None:
        return None
    v, length, stop = stream_of(record)
    period = length / float(np.linalg.norm(v))
    blocks = inf if stop == inf else blocks_until((record.source.start, period), stop, inf)
    return Motion(PlaceOfLastBlock(sway, EntryTimes(record.source.start, period, blocks)))


def time_of_leaving(record):
    """Return the time [s] at which the last block of a body's record has left its shape; infinite
    without `stop`.
    """
    v, length, stop = stream_of(record)
    if stop == inf:
        return inf
    speed, start = float(np.linalg.norm(v)), record.source.start
    blocks = blocks_until((start, length / speed), stop, inf)
    return start + ((blocks - 1) * length + length_along(solid(record.shape), v)) / speed


def length_along(shape, v):
    """Return how far [m] a `Solid` moves along v (d,) until its bounding box no longer overlaps
    where it was. Raises ValueError for a shape without end.
    """
    extent = check_bounded(shape).high - shape.low
    along = np.abs(v) / np.linalg.norm(v)
    return float(min(w / a for w, a in zip(extent, along, strict=True) if a > 0.0))


def build_sinks(scene):
    """Return the `streams.ParticleSink`s of a scene."""
    sinks = []
    for k, record in enumerate(scene.sink):
        with errors_at(f"sink[{k}].shape"):
            shape = level_set(record.shape)
            distances(np.zeros((1, scene.dim)), shape)
        sinks.append(ParticleSink(shape, record.name))
    return tuple(sinks)
