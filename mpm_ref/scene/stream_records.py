"""Records of the tables by which particles enter and leave: [body.source] and [[sink]]."""

from typing import Annotated

from msgspec import Meta

from ..shapes import Analytic
from ..shapes.quantities import Length, Positive, Record


class Stream(Record):
    """The stream of a body whose shape is filled again and again (see `streams.ParticleSource`)."""

    start: Annotated[float, Meta(ge=0, le=1e12)] = 0.0      # time of the first block [s]
    stop: Positive | None = None                # no block enters from then on [s]
    length: Length | None = None                # of a block along its velocity [m]
    hold: bool = True                           # nodes in the shape have that velocity meanwhile


class Sink(Record):
    """A shape that takes particles out of the run (see `streams.ParticleSink`)."""

    shape: Analytic
    name: str = ""


def check_source(body):
    """Raise ValueError where a body with a source has a key that makes no stream."""
    if body.shape is None:
        raise ValueError("`source` is for a body with a shape, not for `particles`")
    if body.velocity.linear is None or not any(body.velocity.linear):
        raise ValueError("a body with a source needs `velocity.linear`, with which its blocks "
                         "enter")
    if body.velocity.angular not in (0.0, (0.0, 0.0, 0.0)):
        raise ValueError("`velocity.angular` is for a body without source, whose blocks do not "
                         "turn")
    if body.material.is_neural:
        raise ValueError(f"`source` with the law {body.material.law!r}: expected a law by its name")
    if body.source.stop is not None and not body.source.start < body.source.stop:
        raise ValueError(f"source.stop = {body.source.stop}: expected a time after start = "
                         f"{body.source.start}")
