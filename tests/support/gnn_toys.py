"""Graph networks with random weights, and clouds of points that fly in a box."""

from itertools import pairwise

import numpy as np

from mpm_ref.nclaw.gnn.features import (
    HISTORY,
    FeatureSettings,
    MotionScales,
    WallBox,
    straight_flight,
)
from mpm_ref.nclaw.gnn.network import GraphWeights, PerceptronWeights
from mpm_ref.nclaw.gnn.simulator import Simulator

DT = 2.5e-3         # [s] from frame to frame
RADIUS = 0.2        # [m]
WIDTH, BLOCKS = 6, 3


def perceptron(rng, inputs, outputs, norm=True):
    """A `PerceptronWeights` with random numbers in it."""
    layers = tuple((rng.normal(size=(n, m)) / np.sqrt(n), 0.3 * rng.normal(size=m))
                   for n, m in pairwise((inputs, WIDTH, WIDTH, outputs)))
    scale = (1.0 + 0.2 * rng.normal(size=outputs), 0.1 * rng.normal(size=outputs))
    return PerceptronWeights(layers, scale if norm else ())


def network(d=3, seed=0):
    """A `GraphWeights` with random numbers in it."""
    rng = np.random.default_rng(seed)
    blocks = tuple((perceptron(rng, 3 * WIDTH, WIDTH), perceptron(rng, 2 * WIDTH, WIDTH))
                   for _ in range(BLOCKS))
    return GraphWeights(perceptron(rng, (HISTORY + 2) * d, WIDTH), perceptron(rng, d + 1, WIDTH),
                   blocks, perceptron(rng, WIDTH, d, norm=False))


def reading(d=3):
    """`FeatureSettings` of points that fly at about 1 m/s."""
    scales = MotionScales(np.linspace(-1e-3, 1e-3, d), np.linspace(2e-3, 3e-3, d),
                          np.linspace(1e-6, 2e-6, d), np.linspace(3e-4, 4e-4, d))
    return FeatureSettings(RADIUS, DT, scales)


def simulator(d=3, seed=0):
    """A `Simulator` with random numbers in it."""
    return Simulator(network(d, seed), reading(d), {"seed": seed})


def box(d=3):
    """The box from 0 to 1."""
    return WallBox(np.zeros(d), np.ones(d))


def flight(d=3, n=40, seed=0):
    """Positions and velocities (n, d) of points, some nearer than RADIUS to walls of `box`."""
    rng = np.random.default_rng(seed)
    return rng.uniform(0.05, 0.95, (n, d)), rng.normal(size=(n, d))


def frames(d=3, n=40, seed=0):
    """Frames (HISTORY + 1, n, d) of a flight that is not quite straight."""
    x, v = flight(d, n, seed)
    bends = 1e-4 * np.random.default_rng(seed + 1).normal(size=(HISTORY + 1, n, d))
    return straight_flight(x, v, DT) + bends


def braked(k=7, seed=0):
    """Positions (k + 1, n, 3) of a flight whose velocities fall by a fifth from frame to frame, and
    velocities at the start.
    """
    x, v = flight(seed=seed)
    share = (1.0 - 0.8 ** np.arange(k + 1)) / (1.0 - 0.8)
    return x + DT * v * share[:, None, None], v
