"""Records of the tables by which particles enter and leave: [body.source] and [[sink]]."""

from typing import Annotated

from msgspec import Meta

from ..shapes import Analytic
from ..shapes.quantities import Length, NotNegative, Positive, Record, Vector

Frequencies = Annotated[tuple[NotNegative, ...], Meta(min_length=2, max_length=3)]      # [1/s]


class Sway(Record):
    """amplitude sin(2 pi frequency t) along each axis, t the time of the run: by how much a source
    is displaced.
    """

    amplitude: Vector                           # [m]
    frequency: Frequencies                      # [1/s]

    def __post_init__(self):
        if len(self.frequency) != len(self.amplitude):
            raise ValueError(f"frequency = {list(self.frequency)}: expected "
                             f"{len(self.amplitude)} numbers, one for each of `amplitude`")
        for a, f in zip(self.amplitude, self.frequency, strict=True):
            if a != 0.0 and f == 0.0:
                raise ValueError(f"amplitude = {list(self.amplitude)} with frequency = "
                                 f"{list(self.frequency)}: expected a frequency > 0 wherever the "
                                 "amplitude is not 0")


class Stream(Record):
    """The stream of a body whose shape is filled again and again (see `streams.ParticleSource`)."""

    start: Annotated[float, Meta(ge=0, le=1e12)] = 0.0      # time of the first block [s]
    stop: Positive | None = None                # no block enters from then on [s]
    length: Length | None = None                # of a block along its velocity [m]
    hold: bool = True                           # nodes in the shape have that velocity meanwhile
    sway: Sway | None = None                    # of the shape; none: it stands still


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
