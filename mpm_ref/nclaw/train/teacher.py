"""Teacher forcing: a trajectory in segments, each from the observed state (NCLAW-train).

The horizon of a segment grows over the training from 25 to 200 steps by half a cosine. As in the
authors' release a trajectory of k steps falls into ceil(k / horizon) segments of nearly equal
length, so that the longest horizon is not quite reached: 1000 steps end in 6 of 166 or 167.
"""

from math import ceil, cos, pi
from typing import NamedTuple

import numpy as np


class Teacher(NamedTuple):
    """Horizons [steps], at least 1, at the first epoch and after the last."""

    first: int = 25
    last: int = 200

    def horizon(self, epoch, epochs):
        """Steps between restarts in an epoch, counted from 0."""
        share = 0.5 * (1.0 + cos(pi * epoch / epochs))
        return self.last + (self.first - self.last) * share

    def restarts(self, steps, epoch, epochs):
        """First steps of the segments, and as the last entry the number of steps."""
        count = ceil(steps / self.horizon(epoch, epochs))
        part = np.floor(np.linspace(0.0, count, steps, endpoint=False))
        return [0, *(1 + np.flatnonzero(np.diff(part))).tolist(), steps]
