"""The graph networks that NCLaw's laws are compared with, and the runs that they learn from.

The paper trains them on 1, 10 and 100 runs, "as much as possible" as [GNS], and says no more. The
first run is the one that laws learn from; the others have velocities like those of task (b), from
other seeds. Frames are 5 steps apart. What is smaller here than in [GNS], and by how much, stands
in docs/explanation/nclaw.md.
"""

from typing import NamedTuple

import numpy as np

from mpm_ref.body import restore_order
from mpm_ref.nclaw.bodies import copy_body
from mpm_ref.nclaw.gnn.features import box_of
from mpm_ref.nclaw.study.compare import positions
from mpm_ref.scene import build
from mpm_ref.store.text import counted

from ..common.scenes import threads_for
from .environments import ENVIRONMENTS
from .tasks import reconstruction, velocity

COUNTS = (1, 10, 100)       # of runs
THEIR_WIDTH, THEIR_STEPS, THEIR_BATCH = 128, 20_000_000, 2
FIRST_SEED = 100            # of the second run; those of task (b) are 1, 7 and 8


class GraphNet(NamedTuple):
    """A graph network that is trained on an environment, and how (`nclaw.gnn.train.recipe`)."""

    environment: str
    runs: int = 1
    steps: int = 15_000
    width: int = 32
    batch: int = 1
    noise: float = 1e-4         # [m per frame]
    first_rate: float = 1e-3
    last_rate: float = 1e-5
    seed: int = 0
    method: str = "gnn"

    @property
    def description(self):
        """The size of the training compared with that of [GNS], in words."""
        return (f"a graph network {self.width} wide, trained on {counted(self.runs, 'run')} for "
                f"{self.steps} steps with {counted(self.batch, 'frame')} each; that of [GNS]: "
                f"{THEIR_WIDTH} wide, up to {THEIR_STEPS} steps with {THEIR_BATCH}")


class FramedRun(NamedTuple):
    """A run in frames: positions, velocities at the start, walls."""

    x: np.ndarray       # (k + 1, n, d) [m]
    v: np.ndarray       # (n, d) [m/s]
    box: tuple          # `nclaw.gnn.features.WallBox`
    dt: float           # [s] between frames


def simulators():
    """Return {name: `GraphNet`} of all experiments: ENVIRONMENT-gnn of one run, ENVIRONMENT-gnn-10,
    ..
    """
    return {named(name, count): GraphNet(name, count)
            for name in ENVIRONMENTS for count in COUNTS}


def named(environment, count):
    """Return the name of the network that learns from `count` runs."""
    return f"{environment}-gnn" if count == 1 else f"{environment}-gnn-{count}"


def scenes_of(net):
    """Return the scenes that a `GraphNet` learns from."""
    others = range(FIRST_SEED, FIRST_SEED + net.runs - 1)
    return [reconstruction(net.environment), *(velocity(net.environment, k) for k in others)]


def framed_run(scene):
    """Return the `FramedRun` of a scene."""
    problem = build(scene)
    with threads_for(problem.bodies):
        x = np.array(list(positions(problem, tuple(map(copy_body, problem.bodies)))))
    return FramedRun(x, *start(problem)[1:], problem.clock.every * problem.clock.dt)


def start(problem):
    """Return positions and velocities (n, d) of all points of a problem at the start, and its
    walls.
    """
    x, v = (np.concatenate([restore_order(getattr(body.particles, name), body.id)
                            for body in problem.bodies]) for name in "xv")
    return x, v, box_of(problem.conditions.walls, problem.dx)
