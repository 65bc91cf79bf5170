"""The error of laws on a task: the mean squared distance of their runs from the true one
(NCLAW-eval).

A frame's error is the mean over points and axes of (x - x_true)^2; a run's that over its frames,
the first one, which is zero, included. Runs go side by side, none is kept.

A run breaks down where a coordinate of a point is not a number any more. The authors' release has
no guard: it goes on, with all points clipped to the upper corner of their box. Its errors before
training in task (a) are of that corner in good part, which `goes_on` is for.
"""

from typing import NamedTuple

import numpy as np

from mpm_ref.body import Body, particles_at
from mpm_ref.cases import in_order
from mpm_ref.core.grid import OutOfRange
from mpm_ref.materials import Material
from mpm_ref.nclaw import deployed
from mpm_ref.scene import build
from mpm_ref.simulate import SORT, keep_inside

from ..verification.scenes import threads_for


class Broken(ValueError):
    """A run does not go on: attributes step and why."""

    def __init__(self, step, why):
        self.step, self.why = step, why
        super().__init__(f"step {step}: {why}")


class Found(NamedTuple):
    """What became of a run."""

    error: float            # [m^2]; infinite if it broke down, unless it goes on
    step: int = -1          # in which it broke down
    why: str = ""


class Follower:
    """A run beside the true one, and the sum of the errors of its frames."""

    def __init__(self, frames, corner):
        self.frames, self.corner = frames, corner
        self.total, self.count, self.broken = 0.0, 0, None

    def follow(self, x):
        """The next frame, where the true one is x."""
        self.total += float(np.mean((self.place() - x) ** 2))
        self.count += 1

    def place(self):
        """Positions in the next frame; the corner for all points of a run that broke down."""
        if self.broken is None:
            try:
                return next(self.frames)
            except Broken as end:
                self.broken = end
        return self.corner

    def found(self):
        """`Found` so far."""
        broken = () if self.broken is None else (self.broken.step, self.broken.why)
        return Found(self.total / self.count, *broken)


def compare(scene, laws, goes_on=False):
    """[`Found`] of some laws on a scene. Raises `Broken` if its own laws break down.

    laws: functions that make of a body at the start the same one of other laws, see `fresh`;
    goes_on: points of runs that break down stay in a corner, as in the release; else the error of
    such a run is infinite.
    """
    problem = build(scene)
    corner = problem.clip[1] if goes_on else np.inf
    with threads_for(problem.bodies):
        runs = [Follower(positions(problem, tuple(map(law, problem.bodies))), corner)
                for law in laws]
        for x in positions(problem, tuple(map(own, problem.bodies))):
            for run in runs:
                run.follow(x)
    return [run.found() for run in runs]


def positions(problem, bodies):
    """Positions (n, d) of all points at the start and at each frame, bodies one after the other, in
    their own order. The run is that of `simulate`, not stopped for its energy or its speed; raises
    `Broken` where a point has no finite place.
    """
    clock, stepper = problem.clock, problem.stepper()
    stepper.start(bodies)
    yield placed(bodies)
    for k in range(clock.steps):
        try:
            if k % SORT == 0:
                stepper.sort(bodies)
            stepper.step(bodies, k * clock.dt, clock.dt)
        except OutOfRange as error:
            raise Broken(k, str(error)) from None
        if problem.clip is not None:
            keep_inside(bodies, *problem.clip)
        if (k + 1) % clock.every == 0:
            x = placed(bodies)
            if not np.isfinite(x).all():
                p = int(np.argwhere(~np.isfinite(x))[0, 0])
                raise Broken(k + 1, f"particle {p} has position {x[p]}")
            yield x


def placed(bodies):
    """Positions (n, d) of the points of bodies."""
    return np.concatenate([in_order(body.particles.x, body.id) for body in bodies])


def fresh(body, law, flow):
    """A body as it was sampled, of other laws; particles of its own."""
    q = body.particles
    particles = particles_at(q.x, q.v, q.m, q.V0, "mls",
                             fluid=not Material(law, flow).needs_F)
    return Body(body.name, particles, law, flow, body.id.copy())


def own(body):
    """A body of its own laws."""
    return fresh(body, body.law, body.flow)


def learned(laws):
    """What makes bodies of trained `nclaw.weights.Laws`."""
    elastic, plastic = deployed.elastic(laws.elastic), deployed.plastic(laws.plastic)
    return lambda body: fresh(body, elastic, plastic)
