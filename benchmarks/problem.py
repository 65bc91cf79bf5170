"""Define the problem for all backends: an elastic cube that falls in a box.

The cube has c^3 cells with 8 particles each, the box (2c)^3 cells. MLS-MPM, quadratic splines,
fixed corotated elasticity, gravity, slip walls three cells from the faces of the box; double
precision. All backends get the same arrays and do the same arithmetic, up to its order.
"""

from typing import NamedTuple

import numpy as np

E, NU, RHO = 1e4, 0.3, 1000.0      # [Pa], [1], [kg/m^3]
GRAVITY = -9.8                     # [m/s^2] along the last axis
WALL = 3                           # nodes


class Block(NamedTuple):
    """Initial state and constants of the block."""

    x: np.ndarray     # (N, 3) [m]
    v: np.ndarray     # (N, 3) [m/s]
    F: np.ndarray     # (N, 3, 3)
    m: float          # mass of a particle [kg]
    V0: float         # its volume [m^3]
    n: int            # nodes per axis
    dx: float         # [m]
    dt: float         # [s]
    mu: float         # [Pa]
    lam: float        # [Pa]


class LossOfRun(NamedTuple):
    """The loss sum_p w_p . x_p of a `Block` after some steps [m], linear in the positions."""

    block: Block
    w: np.ndarray     # (N, 3)
    steps: int


def block(cells, shuffle=False, seed=0):
    """Return a `Block` of cells^3 cells in the box [0, 1]^3, with a small smooth deformation."""
    n = 2 * cells
    dx = 1.0 / n
    axis = 0.25 + (np.arange(2 * cells) + 0.5) * 0.5 * dx
    x = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), -1).reshape(-1, 3)
    v = 0.5 * np.sin(2.0 * np.pi * x[:, [1, 2, 0]])
    F = np.eye(3) + 0.02 * np.cos(2.0 * np.pi * x)[:, :, None] * np.ones(3)
    if shuffle:
        order = np.random.default_rng(seed).permutation(len(x))
        x, v, F = x[order], v[order], F[order]
    mu, lam = E / (2.0 * (1.0 + NU)), E * NU / ((1.0 + NU) * (1.0 - 2.0 * NU))
    V0 = (0.5 * dx) ** 3
    dt = 0.2 * dx / np.sqrt((lam + 2.0 * mu) / RHO)
    return Block(x, v, np.ascontiguousarray(F), RHO * V0, V0, n, dx, dt, mu, lam)


def loss_of_run(block, steps, seed=0):
    """Return the `LossOfRun` of a `Block` with weights that are drawn from a normal distribution.

    Walls would make it a loss without a gradient where a velocity passes zero; blocks of 7 cells
    and more do not reach them in a few steps.
    """
    return LossOfRun(block, np.random.default_rng(seed).standard_normal(block.x.shape), steps)
