"""A trained graph network as a simulator: positions frame after frame, each from the last ones."""

from functools import partial
from typing import NamedTuple

import numpy as np

from .features import (
    FeatureSettings,
    SimulatorFailure,
    edge_features,
    neighbour_graph,
    next_positions,
    point_features,
    straight_flight,
)
from .network import GraphWeights, answers


class Simulator(NamedTuple):
    """A trained network, the settings of its features, and the record of its training."""

    network: GraphWeights
    reading: FeatureSettings
    about: dict         # plain values

    def run(self, x, v, box):
        """Return the generator `free_run` of the network from positions x [m] and velocities
        v [m/s], (n, d).
        """
        frames = straight_flight(x, v, self.reading.dt)
        return free_run(partial(answers, self.network), self.reading, frames, box)


def free_run(answer, reading, frames, box):
    """Yield the positions (n, d) [m] in the last of frames (HISTORY + 1, n, d), and in all that
    follow, without end.

    answer: function of the features of points and of edges, and of the graph, to (n, d).
    Raises `SimulatorFailure` as `features.neighbour_graph`, and for a point without a finite place.
    """
    while True:
        x = frames[-1]
        require_finite(x)
        yield x
        graph = neighbour_graph(x, reading.radius)
        y = answer(point_features(frames, box, reading), edge_features(x, graph, reading.radius),
                   graph)
        frames = np.concatenate([frames[1:], next_positions(frames, y, reading.scales)[None]])


def require_finite(x):
    """Raise `SimulatorFailure` unless all points x (n, d) have a finite place."""
    lost = np.flatnonzero(~np.isfinite(x).all(axis=1))
    if len(lost):
        raise SimulatorFailure(f"point {lost[0]} is at {x[lost[0]]}: expected a finite place; did "
                               "the simulator learn too little, or is the body unlike those it "
                               "learned from?")
