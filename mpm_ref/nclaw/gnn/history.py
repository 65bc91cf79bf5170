"""What points and edges are told, and what an answer makes of it [GNS].

    point   u_-4, .., u_0 without their mean, over their deviation;    u_k = x_k - x_{k-1}
            distances to the walls over the radius, cut to [-1, 1]
    edge    r = (x_sender - x_receiver) / radius, and |r|
    answer  an acceleration without its mean, over its deviation;    x_1 = x_0 + u_0 + a

Time counts in frames: velocities are in m, accelerations too. No place in space is told but by
the walls, so that answers do not change where bodies and walls move together.

[GNS] is given six true frames to start from. A law is given positions and velocities at the start,
and so is this: before it points have flown straight (`begun`), in training as in any other run.
"""

from typing import NamedTuple

import numpy as np

HISTORY = 5         # velocities that are told


class Scales(NamedTuple):
    """Means and deviations (d,) of velocities and accelerations, noise included [m]."""

    v_mean: np.ndarray
    v_std: np.ndarray
    a_mean: np.ndarray
    a_std: np.ndarray


class Reading(NamedTuple):
    """How frames are read."""

    radius: float       # [m] within which points are neighbours
    dt: float           # [s] from frame to frame
    scales: Scales


class Box(NamedTuple):
    """Places of the walls (d,) [m], -inf or inf where there is none."""

    low: np.ndarray
    high: np.ndarray


def box_of(walls, dx):
    """`Box` of `core.boundary.BoxWalls` on a grid: the walls stand at their last nodes, such as at
    0.1 m and 0.9 m in NCLAW-sim.
    """
    return Box(np.array([-np.inf if k is None else (k - 1) * dx for k in walls.low]),
               np.array([np.inf if k is None else (k + 1) * dx for k in walls.high]))


def begun(x, v, dt):
    """Frames (HISTORY + 1, n, d), dt [s] apart, of a straight flight up to x [m] with v [m/s]."""
    return x - np.arange(HISTORY, -1, -1)[:, None, None] * (dt * v)


def of_points(frames, box, reading):
    """What points are told (n, (HISTORY + 2) d) in the last of frames (HISTORY + 1, n, d) [m]."""
    x, scales = frames[-1], reading.scales
    u = (np.diff(frames, axis=0) - scales.v_mean) / scales.v_std
    gaps = np.hstack([x - box.low, box.high - x]) / reading.radius
    return np.hstack([*u, np.clip(gaps, -1.0, 1.0)])


def of_edges(x, graph, radius):
    """What edges of points x (n, d) are told (k, d + 1)."""
    r = (x[graph.senders] - x[graph.receivers]) / radius
    return np.hstack([r, np.linalg.norm(r, axis=1, keepdims=True)])


def following(frames, answer, scales):
    """Positions (n, d) [m] in the next frame, of an answer (n, d)."""
    return 2.0 * frames[-1] - frames[-2] + scales.a_mean + scales.a_std * answer


def expected(frames, after, scales):
    """The answer (n, d) that gives positions `after` (n, d): `following` backwards."""
    return (after - 2.0 * frames[-1] + frames[-2] - scales.a_mean) / scales.a_std
