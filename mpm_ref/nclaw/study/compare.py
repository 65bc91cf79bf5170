"""Comparison of a run of a scene by other laws with the run by its own laws (NCLAW-eval).

The error of a frame is the mean over points and axes of (x - x_true)^2, that of a run the mean over
its frames, the first included, which is zero. Both runs advance together; neither is stored.

A run breaks down where a coordinate of a point is not finite.
"""

import csv
from contextlib import nullcontext
from typing import NamedTuple

import msgspec
import numpy as np

from ...body import keep_inside, restore_order
from ...core.grid import OutOfRange
from ...rom.study.generate import one_thread
from ...scene import SceneError, build
from ...simulate import SORT, last_step
from ...store.atomic import replacing
from ..bodies import copy_body

FEW = 5000      # particles, up to which a second thread would wait more than it works


class RunBroken(ValueError):
    """A run that cannot go on, with the attributes step and why."""

    def __init__(self, step, why):
        self.step, self.why = step, why
        super().__init__(f"step {step}: {why}")


class ComparedError(NamedTuple):
    """The error of a run, and where it broke down."""

    error: float            # [m^2]; infinite if it broke down, unless it goes on
    step: int = -1          # in which it broke down
    why: str = ""


class ComparedRun:
    """A run that is compared with the true one, and the sum of the errors of its frames."""

    def __init__(self, frames, corner):
        self.frames, self.corner = frames, corner
        self.total, self.count, self.broken = 0.0, 0, None

    def follow(self, x):
        """Return the error of the next frame [m^2], where the true one is x."""
        error = float(np.mean((self.place() - x) ** 2))
        self.total += error
        self.count += 1
        return error

    def place(self):
        """Return the positions in the next frame; the corner for all points of a run that broke
        down.
        """
        if self.broken is None:
            try:
                return next(self.frames)
            except RunBroken as end:
                self.broken = end
        return self.corner

    def error(self):
        """Return the `ComparedError` so far."""
        broken = () if self.broken is None else (self.broken.step, self.broken.why)
        return ComparedError(self.total / self.count, *broken)


def compare_runs(problem, law):
    """Yield (error of a frame [m^2], `ComparedError` so far) of a run of a problem by another law.

    law: a function that makes a body of it, see `nclaw.bodies.body_maker`. Errors are infinite from
    where that law breaks down. Raises `RunBroken` where the problem's own laws break down.
    """
    with threads_for(problem.bodies):
        run = ComparedRun(positions(problem, tuple(map(law, problem.bodies))), np.inf)
        for x in positions(problem, tuple(map(copy_body, problem.bodies))):
            yield run.follow(x), run.error()


def threads_for(bodies):
    """Return a context of one thread where there are few particles; bits do not depend on it."""
    few = sum(len(body.id) for body in bodies) <= FEW
    return one_thread() if few else nullcontext()


def positions(problem, bodies):
    """Yield the positions (n, d) of all points at the start and at each frame, bodies one after the
    other, in their own order. The run is that of `simulate`, not stopped for its energy or its
    speed; raises `RunBroken` where a point has no finite place.
    """
    clock, stepper = problem.clock, problem.stepper()
    stepper.start(bodies)
    yield body_positions(bodies)
    for k in range(clock.steps):
        try:
            if k % SORT == 0:
                stepper.sort(bodies)
            stepper.step(bodies, k * clock.dt, clock.dt)
        except OutOfRange as error:
            raise RunBroken(k, str(error)) from None
        if problem.clip is not None:
            keep_inside(bodies, *problem.clip)
        if (k + 1) % clock.every == 0:
            x = body_positions(bodies)
            if not np.isfinite(x).all():
                p = int(np.argwhere(~np.isfinite(x))[0, 0])
                raise RunBroken(k + 1, f"particle {p} has position {x[p]}")
            yield x


def body_positions(bodies):
    """Return the positions (n, d) of the points of bodies."""
    return np.concatenate([restore_order(body.particles.x, body.id) for body in bodies])


def problem_of(scene, source, steps=None):
    """Return the `Problem` of a scene that `positions` runs: explicit steps of fixed length, of one
    material. steps: length of the run (default: the scene's). Frames are those of the scene, or
    every step if it names none. Raises SceneError.
    """
    if scene.integrator != "explicit" or scene.dt is None:
        raise SceneError(f'{source}: expected the integrator "explicit" and a fixed `dt`, so that '
                         "both runs take the same steps")
    if scene.interval is not None:
        raise SceneError(f"{source}: interval = {scene.interval}: expected frames by `every`")
    steps = steps or last_step(build(scene, source).clock)
    require_one_material(scene, source)
    return build(msgspec.structs.replace(scene, steps=steps, end=None,
                                         every=min(scene.every or 1, steps)), source)


def require_one_material(scene, source):
    """Raise SceneError where bodies of a scene differ in their material."""
    if any(body.material != scene.body[0].material for body in scene.body):
        raise SceneError(f"{source}: its bodies are of several materials, expected one, in whose "
                         "place the learned laws stand")


def write_errors(errors, clock, out):
    """Write the errors of frames [m^2] as CSV, with their steps and times [s]."""
    rows = ((k, k * clock.every, k * clock.every * clock.dt, error)
            for k, error in enumerate(errors))
    write_rows(("frame", "step", "t", "error"), rows, out)


def write_rows(columns, rows, out):
    """Write rows as CSV, whole or not at all. Raises NotWritten."""
    with replacing(out) as part, open(part, "w", newline="", encoding="utf-8") as file:
        table = csv.writer(file)
        table.writerow(columns)
        table.writerows(rows)
