"""The simplest rivals of learned laws, which cost no run: points that stay, and points that fly as
if nothing held them together.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np


class PositionRival(NamedTuple):
    """Positions that follow from the start of a problem alone."""

    place: Callable         # (problem, x (n, d), v (n, d), t [s]) -> x (n, d)

    def frames(self, problem):
        """Yield positions (n, d) at the start and at each frame of a `Problem`."""
        clock = problem.clock
        x, v = (np.concatenate([getattr(body.particles, name) for body in problem.bodies])
                for name in "xv")
        for step in range(0, clock.steps + 1, clock.every):
            yield self.place(problem, x, v, step * clock.dt)


def stay(problem, x, v, t):
    """Return the positions at the start."""
    return x


def fly(problem, x, v, t):
    """Return the positions of free flight; at the walls of the problem's clip they end."""
    flown = x + t * v + 0.5 * t * t * problem.gravity
    return flown if problem.clip is None else np.clip(flown, *problem.clip)


RIVALS = {"no-motion": PositionRival(stay), "ballistic": PositionRival(fly)}
