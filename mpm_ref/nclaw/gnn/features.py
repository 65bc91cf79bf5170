"""Features of points and edges, the network's inputs, and positions from its outputs [GNS].

    point   u_-4, .., u_0 without their mean, over their deviation;    u_k = x_k - x_{k-1}
            distances to the walls over the radius, cut to [-1, 1]
    edge    r = (x_sender - x_receiver) / radius, and |r|
    answer  an acceleration without its mean, over its deviation;    x_1 = x_0 + u_0 + a

The unit of time is a frame: velocities and accelerations are in m. Distances to the walls are the
only features that depend on the position, so that a shift of bodies and walls together changes
nothing.

[GNS] starts from six true frames. A law starts from positions and velocities, and so does this
simulator: the frames before the start are those of a straight flight (`straight_flight`), in
training as in any other run. Each point is a neighbour of itself too, as in the release of [GNS],
so that none has no neighbour.
"""

from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

HISTORY = 5             # velocities among the features of a point
MAX_EDGES = 1_000_000   # those of 1000 points in one place


class SimulatorFailure(ValueError):
    """A run that cannot go on: a position is not finite, or there are too many neighbours."""


class Graph(NamedTuple):
    """Edges of n points, sorted by receiver, then by sender."""

    senders: np.ndarray     # (k,)
    receivers: np.ndarray   # (k,)

    @property
    def first(self):
        """The first edge of each receiver (n,)."""
        return np.flatnonzero(np.diff(self.receivers, prepend=-1))


def neighbour_graph(x, radius):
    """Return the `Graph` of points x (n, d) [m] that are at most a radius [m] apart.

    Raises `SimulatorFailure` for more than MAX_EDGES edges.
    """
    tree = cKDTree(x)
    count = int(tree.count_neighbors(tree, radius))
    if count > MAX_EDGES:
        raise SimulatorFailure(f"{len(x)} points with {count} edges within {radius} m: expected at "
                               f"most {MAX_EDGES}; take fewer points, or a simulator of a smaller "
                               "radius")
    pairs, itself = tree.query_pairs(radius, output_type="ndarray"), np.arange(len(x))
    senders = np.concatenate([pairs[:, 0], pairs[:, 1], itself])
    receivers = np.concatenate([pairs[:, 1], pairs[:, 0], itself])
    order = np.lexsort((senders, receivers))
    return Graph(senders[order], receivers[order])


class MotionScales(NamedTuple):
    """The means and deviations (d,) of velocities and accelerations, noise included [m]."""

    v_mean: np.ndarray
    v_std: np.ndarray
    a_mean: np.ndarray
    a_std: np.ndarray


class FeatureSettings(NamedTuple):
    """The settings of the features."""

    radius: float       # [m] within which points are neighbours
    dt: float           # [s] from frame to frame
    scales: MotionScales


class WallBox(NamedTuple):
    """Places of the walls (d,) [m], -inf or inf where there is none."""

    low: np.ndarray
    high: np.ndarray


def box_of(walls, dx):
    """Return the `WallBox` of `core.boundary.BoxWalls` on a grid: the walls stand at their last
    nodes, such as at 0.1 m and 0.9 m in NCLAW-sim.
    """
    return WallBox(np.array([-np.inf if k is None else (k - 1) * dx for k in walls.low]),
               np.array([np.inf if k is None else (k + 1) * dx for k in walls.high]))


def straight_flight(x, v, dt):
    """Return frames (HISTORY + 1, n, d), dt [s] apart, of a straight flight up to x [m] with v
    [m/s].
    """
    return x - np.arange(HISTORY, -1, -1)[:, None, None] * (dt * v)


def point_features(frames, box, reading):
    """Return the features of points (n, (HISTORY + 2) d) in the last of frames (HISTORY + 1, n, d)
    [m].
    """
    x, scales = frames[-1], reading.scales
    u = (np.diff(frames, axis=0) - scales.v_mean) / scales.v_std
    gaps = np.hstack([x - box.low, box.high - x]) / reading.radius
    return np.hstack([*u, np.clip(gaps, -1.0, 1.0)])


def edge_features(x, graph, radius):
    """Return the features (k, d + 1) of the edges of points x (n, d)."""
    r = (x[graph.senders] - x[graph.receivers]) / radius
    return np.hstack([r, np.linalg.norm(r, axis=1, keepdims=True)])


def next_positions(frames, answer, scales):
    """Return the positions (n, d) [m] in the next frame, of an answer (n, d)."""
    return 2.0 * frames[-1] - frames[-2] + scales.a_mean + scales.a_std * answer


def target_answer(frames, after, scales):
    """Return the answer (n, d) that gives positions `after` (n, d): `next_positions` backwards."""
    return (after - 2.0 * frames[-1] + frames[-2] - scales.a_mean) / scales.a_std
