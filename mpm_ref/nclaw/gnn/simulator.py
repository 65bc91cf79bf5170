"""A trained graph network as a simulator: positions frame after frame, from those it found."""

from functools import partial
from typing import NamedTuple

import numpy as np

from .graph import Lost, near
from .history import Reading, begun, following, of_edges, of_points
from .network import Network, answers


class Simulator(NamedTuple):
    """A trained network, how it reads frames, and what is known of its training."""

    network: Network
    reading: Reading
    about: dict         # plain values

    def run(self, x, v, box):
        """`free_run` of the network from positions x [m] and velocities v [m/s], (n, d)."""
        return free_run(partial(answers, self.network), self.reading, begun(x, v, self.reading.dt),
                        box)


def free_run(answer, reading, frames, box):
    """Positions (n, d) [m] in the last of frames (HISTORY + 1, n, d), and in all that follow,
    without end.

    answer: function of what points and edges are told, and of the graph, to (n, d).
    Raises `Lost` as `graph.near`, and for a point without a finite place.
    """
    while True:
        x = frames[-1]
        require_finite(x)
        yield x
        graph = near(x, reading.radius)
        found = answer(of_points(frames, box, reading), of_edges(x, graph, reading.radius), graph)
        frames = np.concatenate([frames[1:], following(frames, found, reading.scales)[None]])


def require_finite(x):
    """Raise `Lost` unless all points x (n, d) have a finite place."""
    lost = np.flatnonzero(~np.isfinite(x).all(axis=1))
    if len(lost):
        raise Lost(f"point {lost[0]} is at {x[lost[0]]}: expected a finite place; did the "
                   "simulator learn too little, or is the body unlike those it learned from?")
