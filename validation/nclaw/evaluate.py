"""The error of laws on a task: the mean squared distance of their runs from the true one
(NCLAW-eval).

A frame's error is the mean over points and axes of (x - x_true)^2; a run's that over its frames,
the first one, which is zero, included. Runs go side by side, none is kept.

A run breaks down where a coordinate of a point is not a number any more. The authors' release has
no guard: it goes on, with all points clipped to the upper corner of their box. Its errors before
training in task (a) are of that corner in good part, which `goes_on` is for.
"""

import numpy as np

from mpm_ref.nclaw.bodies import body_maker, body_with_laws, copy_body
from mpm_ref.nclaw.gnn.simulator import Simulator
from mpm_ref.nclaw.study.compare import ComparedError, ComparedRun, RunBroken, positions
from mpm_ref.scene import build

from ..common.scenes import threads_for
from .gnn_rollout import free

__all__ = ["ComparedError", "RunBroken", "body_maker", "body_with_laws", "compare", "copy_body",
           "positions"]


def compare(scene, laws, goes_on=False):
    """[`ComparedError`] of some laws on a scene. Raises `RunBroken` if its own laws break down.

    laws: as of `frames`;
    goes_on: points of runs that break down stay in a corner, as in the release; else the error of
    such a run is infinite.
    """
    problem = build(scene)
    corner = problem.clip[1] if goes_on else np.inf
    with threads_for(problem.bodies):
        runs = [ComparedRun(frames(problem, law), corner) for law in laws]
        for x in positions(problem, tuple(map(copy_body, problem.bodies))):
            for run in runs:
                run.follow(x)
    return [run.error() for run in runs]


def frames(problem, law):
    """Positions in the frames of a problem of a law: a function that makes of a body at the start
    the same one of other laws, see `body_with_laws`; or a graph network, which needs no bodies.
    """
    if isinstance(law, Simulator):
        return free(problem, law)
    return positions(problem, tuple(map(law, problem.bodies)))
