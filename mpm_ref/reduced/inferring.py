"""Reduced runs with inferred stress (NSF), step by step."""

from typing import NamedTuple

import numpy as np

from ..rom.inferred import Inferred, Position, nearest

ENOUGH = 4000       # points that tell where a body is at the start


class Plan(NamedTuple):
    """How a reduced run is made."""

    samples: tuple          # (since [s], numbers of points, sorted), in order of time (NSF-sec5.4)
    faster: float = 1.0     # length of a step over that of the scene
    inversion: str = "nonlinear"

    def at(self, t):
        """The samples of the step that begins at t [s]."""
        return [chosen for since, chosen in self.samples if since <= t][-1]


def model(whole, fields, inversion="nonlinear"):
    """`Inferred` model of a `Whole` scene."""
    problem = whole.problem
    return Inferred(fields, whole.matter, problem.dx, problem.scheme.degree, problem.gravity,
                    problem.conditions, inversion)


def infer(whole, fields, plan, start):
    """Yield (t [s], `Position`, `Report` or None) of a reduced run until the scene ends, the start
    first, which is searched from latent coordinates near it.
    """
    stepper, clock = model(whole, fields, plan.inversion), whole.problem.clock
    dt = plan.faster * clock.dt
    some = np.arange(0, len(whole.X), -(-len(whole.X) // ENOUGH))
    at = Position(nearest(fields, some, whole.X[some], start))
    yield 0.0, at, None
    for k in range(round(clock.steps / plan.faster)):
        at, report = stepper.step(at, plan.at(k * dt), k * dt, dt)
        yield (k + 1) * dt, at, report


def drawn(n, count, seed, since=0.0):
    """Samples drawn once and kept (NSF-sec5.4): (since [s], sorted numbers of `count` of n points).
    Raises ValueError where there are not so many.
    """
    if not 1 <= count <= n:
        raise ValueError(f"{count} samples of {n} points: expected 1 .. {n}")
    return since, np.sort(np.random.default_rng(seed).choice(n, count, replace=False))
