"""What a graph network is shown: frames of runs, with noise on what came before [GNS].

Noise is a walk: each velocity of the history is off by what the one before was off, and by a new
random number. Positions are off by the sum. What is expected is the acceleration to the true next
velocity, so that the network learns to take back the error of the last one, not that of positions.
"""

from typing import NamedTuple

import numpy as np
import torch

from ..graph import Graph, near
from ..history import HISTORY, Box, Scales, begun, expected, of_edges, of_points


class Run(NamedTuple):
    """A run that is learned from, HISTORY frames of straight flight before it."""

    frames: np.ndarray      # (HISTORY + k + 1, n, d) positions [m]
    box: Box

    @property
    def count(self):
        """How many frames follow another one: k."""
        return len(self.frames) - HISTORY - 1


class Example(NamedTuple):
    """What is told, and what is expected; tensors in single precision."""

    points: torch.Tensor
    edges: torch.Tensor
    graph: Graph            # of tensors
    answer: torch.Tensor


def run_of(x, v, dt, box):
    """`Run` of positions x (k + 1, n, d) [m], dt [s] apart, and velocities at the start v [m/s].

    Raises ValueError for fewer than two frames, and for numbers that are not finite.
    """
    if len(x) < 2:
        raise ValueError(f"a run of {len(x)} frames: expected at least two")
    if not (np.isfinite(x).all() and np.isfinite(v).all()):
        raise ValueError("a run with positions or velocities that are not finite numbers: learn "
                         "from another one")
    return Run(np.concatenate([begun(x[0], v, dt)[:-1], x]), box)


def scales_of(runs, noise):
    """`Scales` of the velocities and accelerations that are expected in some runs, and of noise."""
    u = [np.diff(run.frames[HISTORY - 1:], axis=0) for run in runs]
    d = u[0].shape[-1]
    found = [np.concatenate([b.reshape(-1, d) for b in a])
             for a in (u, [np.diff(one, axis=0) for one in u])]
    return Scales(*(b for a in found for b in (a.mean(axis=0), np.hypot(a.std(axis=0), noise))))


def walk(draws, shape, noise):
    """Errors of positions (HISTORY + 1, n, d), the first ones zero; the last velocity's deviation
    is `noise`. shape: n, d; draws: a `numpy.random.Generator`.
    """
    steps = draws.normal(scale=noise / np.sqrt(HISTORY), size=(HISTORY, *shape))
    return np.concatenate([np.zeros((1, *shape)), steps.cumsum(axis=0).cumsum(axis=0)])


def example(run, k, reading, noise):
    """`Example` of frame k of a `Run`, counted from 0; noise (HISTORY + 1, n, d) [m]."""
    frames = run.frames[k:k + HISTORY + 1] + noise
    x, after = frames[-1], run.frames[k + HISTORY + 1] + noise[-1]
    graph = near(x, reading.radius)
    return Example(single(of_points(frames, run.box, reading)),
                   single(of_edges(x, graph, reading.radius)),
                   Graph(*map(torch.from_numpy, graph)),
                   single(expected(frames, after, reading.scales)))


def single(a):
    """An array as a tensor in single precision."""
    return torch.from_numpy(a).float()
