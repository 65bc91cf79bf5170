"""The settings of a training: segments of the trajectory, rates, loss (NCLAW-train).

Teacher forcing runs a trajectory in segments, each from the observed state. The horizon of a
segment grows over the training from 25 to 200 steps by half a cosine. As in the authors' release a
trajectory of k steps falls into ceil(k / horizon) segments of nearly equal length, so that the
longest horizon is not quite reached: 1000 steps end in 6 of 166 or 167.
"""

from dataclasses import dataclass
from math import ceil, cos, pi
from typing import NamedTuple

import numpy as np

RELEASE, PRINTED = "release", "printed"
READINGS = (RELEASE, PRINTED)
SEEDS = 2**32       # number of different seeds of PyTorch


class TeacherForcing(NamedTuple):
    """Horizons [steps], at least 1, at the first epoch and after the last."""

    first: int = 25
    last: int = 200

    def horizon(self, epoch, epochs):
        """Return the steps between restarts in an epoch, counted from 0."""
        share = 0.5 * (1.0 + cos(pi * epoch / epochs))
        return self.last + (self.first - self.last) * share

    def restarts(self, steps, epoch, epochs):
        """Return the first steps of the segments, and as the last entry the number of steps."""
        count = ceil(steps / self.horizon(epoch, epochs))
        part = np.floor(np.linspace(0.0, count, steps, endpoint=False))
        return [0, *(1 + np.flatnonzero(np.diff(part))).tolist(), steps]


@dataclass(frozen=True)
class Recipe:
    """Settings of a training whose epoch is one trajectory, in segments (see `TeacherForcing`), and
    one step of Adam for each law.

    Rates fall to 0 by half a cosine; the gradients of each law are clipped to a norm of `clip`. The
    loss of the authors' "release" is the sum over steps of mean squared errors [m^2] times `scale`
    times segments over steps: not printed, and part of the recipe, since gradients are small beside
    the 1e-8 that Adam adds to their size. The "printed" one is the mean over steps, in m^2.
    `batch` segments run at once, which affects only time and round-off. The backward sweep keeps
    at least every `keep_every`-th of their states and computes others anew, which affects memory,
    time and round-off. `seed` is that of the laws' start, and of the order of pairs (see
    `labeled`). `velocity` [s^2] weighs squared errors of velocities beside those of positions
    (NCLAW-aux, printed without its value). `idempotence` [m^2] weighs what a second return map
    changes of F beside squared errors of positions: it is ours, and nothing for a projection.
    """

    epochs: int = 300
    elastic_rate: float = 1.0
    plastic_rate: float = 0.1
    clip: float = 0.1
    first: int = 25             # horizon of the teacher at the first epoch [steps]
    last: int = 200             # ... and after the last
    reading: str = RELEASE
    scale: float = 1e4
    seed: int = 0
    batch: int = 8
    keep_every: int = 1         # [steps]
    velocity: float = 0.0
    idempotence: float = 0.0

    def __post_init__(self):
        for name in ("epochs", "first", "last", "batch", "keep_every"):
            if getattr(self, name) < 1:
                raise ValueError(f"{name} = {getattr(self, name)}: expected at least 1")
        for name in ("elastic_rate", "plastic_rate", "clip", "scale"):
            if not getattr(self, name) > 0.0:
                raise ValueError(f"{name} = {getattr(self, name)}: expected a positive number")
        for name in ("velocity", "idempotence"):
            if not 0.0 <= getattr(self, name) < float("inf"):
                raise ValueError(f"{name} = {getattr(self, name)}: expected a number >= 0")
        if not 0 <= self.seed < SEEDS:
            raise ValueError(f"seed = {self.seed}: expected 0 .. {SEEDS - 1}")
        if self.reading not in READINGS:
            raise ValueError(f"reading = {self.reading!r}: expected {' or '.join(READINGS)}")

    @property
    def teacher(self):
        """Return the `TeacherForcing` of the horizons."""
        return TeacherForcing(self.first, self.last)

    def weight(self, segments, steps):
        """Return the factor of the sum over steps of mean squared errors."""
        return self.scale * segments / steps if self.reading == RELEASE else 1.0 / steps
