"""Examples for the training of graph networks: frames of runs with noise in their history [GNS].

The noise is a random walk: the error of each velocity of the history is that of the one before plus
a new random number. The error of a position is the sum of those of the velocities. The target is
the acceleration to the true next velocity, so that the network learns to correct the error of the
last velocity, not that of positions.
"""

from typing import NamedTuple

import numpy as np
import torch

from ..features import (
    HISTORY,
    Graph,
    MotionScales,
    WallBox,
    edge_features,
    neighbour_graph,
    point_features,
    straight_flight,
    target_answer,
)


class TrainingRun(NamedTuple):
    """A run to learn from, with HISTORY frames of straight flight before it."""

    frames: np.ndarray      # (HISTORY + k + 1, n, d) positions [m]
    box: WallBox

    @property
    def count(self):
        """Return the number k of frames that follow another one."""
        return len(self.frames) - HISTORY - 1


class TrainingExample(NamedTuple):
    """The features and the expected answer of a frame; tensors in single precision."""

    points: torch.Tensor
    edges: torch.Tensor
    graph: Graph            # of tensors
    answer: torch.Tensor


def training_run(x, v, dt, box):
    """Return the `TrainingRun` of positions x (k + 1, n, d) [m], dt [s] apart, and velocities v
    [m/s] at the start.

    Raises ValueError for fewer than two frames, and for numbers that are not finite.
    """
    if len(x) < 2:
        raise ValueError(f"a run of {len(x)} frames: expected at least two")
    if not (np.isfinite(x).all() and np.isfinite(v).all()):
        raise ValueError("a run with positions or velocities that are not finite numbers: learn "
                         "from another one")
    return TrainingRun(np.concatenate([straight_flight(x[0], v, dt)[:-1], x]), box)


def scales_of(runs, noise):
    """Return the `MotionScales` of velocities and accelerations in some runs, and of noise."""
    u = [np.diff(run.frames[HISTORY - 1:], axis=0) for run in runs]
    d = u[0].shape[-1]
    rates = [np.concatenate([b.reshape(-1, d) for b in a])
             for a in (u, [np.diff(one, axis=0) for one in u])]
    return MotionScales(*(b for a in rates
                          for b in (a.mean(axis=0), np.hypot(a.std(axis=0), noise))))


def random_walk(draws, shape, noise):
    """Return the errors of positions (HISTORY + 1, n, d), the first ones zero; the last velocity's
    deviation is `noise`. shape: n, d; draws: a `numpy.random.Generator`.
    """
    steps = draws.normal(scale=noise / np.sqrt(HISTORY), size=(HISTORY, *shape))
    return np.concatenate([np.zeros((1, *shape)), steps.cumsum(axis=0).cumsum(axis=0)])


def example(run, k, reading, noise):
    """Return the `TrainingExample` of frame k of a `TrainingRun`, counted from 0.

    noise (HISTORY + 1, n, d) [m] is added to the positions.
    """
    frames = run.frames[k:k + HISTORY + 1] + noise
    x, after = frames[-1], run.frames[k + HISTORY + 1] + noise[-1]
    graph = neighbour_graph(x, reading.radius)
    return TrainingExample(single(point_features(frames, run.box, reading)),
                   single(edge_features(x, graph, reading.radius)),
                   Graph(*map(torch.from_numpy, graph)),
                   single(target_answer(frames, after, reading.scales)))


def single(a):
    """Return an array as a tensor in single precision."""
    return torch.from_numpy(a).float()
