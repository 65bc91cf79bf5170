"""The error of laws on a task: the mean squared distance of their runs from the true one
(NCLAW-eval).

A frame's error is the mean over points and axes of (x - x_true)^2; a run's that over its frames,
the first one, which is zero, included. Runs go side by side, none is kept.

A run breaks down where a coordinate of a point is not a number any more. The authors' release has
no guard: it goes on, with all points clipped to the upper corner of their box. Its errors before
training in task (a) are of that corner in good part, which `goes_on` is for.
"""

from math import isclose

import numpy as np

from mpm_ref.core.blas import one_thread
from mpm_ref.nclaw.bodies import body_maker, body_with_laws, copy_body
from mpm_ref.nclaw.gnn.features import SimulatorFailure
from mpm_ref.nclaw.gnn.simulator import Simulator
from mpm_ref.nclaw.study.compare import ComparedError, ComparedRun, RunBroken, positions
from mpm_ref.scene import build

from ..common.scenes import threads_for
from .rivals import PositionRival
from .simulators import start

__all__ = ["ComparedError", "RunBroken", "body_maker", "body_with_laws", "compare", "copy_body",
           "positions"]


def compare(scene, laws, goes_on=False):
    """Return the `ComparedError`s of some laws on a scene. Raises `RunBroken` if its own laws break
    down.

    laws: as of `frames`;
    goes_on: points of runs that break down stay in a corner, as in the release; else the error of
    such a run is infinite.
    """
    problem = build(scene)
    corner = problem.clip[1] if goes_on else np.inf
    with threads_for(problem.bodies), one_thread():     # graph networks have small products
        runs = [ComparedRun(frames(problem, law), corner) for law in laws]
        for x in positions(problem, tuple(map(copy_body, problem.bodies))):
            for run in runs:
                run.follow(x)
    return [run.error() for run in runs]


def frames(problem, law):
    """Yield positions in the frames of a problem with a law: a function that gives a body other
    laws, see `body_with_laws`; or a graph network or a rival, which need no bodies.
    """
    if isinstance(law, PositionRival):
        return law.frames(problem)
    if isinstance(law, Simulator):
        return rollout(problem, law)
    return positions(problem, tuple(map(law, problem.bodies)))


def rollout(problem, simulator):
    """Yield positions (n, d) [m] of all points at the start and at each frame, of a `Simulator`,
    which is given positions and velocities at the start, and the walls.

    Nothing keeps them in the problem's clip: the largest printed error of a graph network is past
    what a clip allows (NCLAW-X8). Raises `RunBroken` where a point has no finite place or too many
    crowd together, ValueError for frames unlike those that it has learned.
    """
    clock, learned = problem.clock, simulator.reading.dt
    if not isclose(clock.every * clock.dt, learned, rel_tol=1e-9):
        raise ValueError(f"every = {clock.every}: frames {clock.every * clock.dt:g} s apart; the "
                         f"simulator has learned {learned:g} s: set every = {learned / clock.dt:g}")
    run = simulator.run(*start(problem))
    for step in range(0, clock.steps + 1, clock.every):
        try:
            yield next(run)
        except SimulatorFailure as fault:
            raise RunBroken(step, str(fault)) from None
