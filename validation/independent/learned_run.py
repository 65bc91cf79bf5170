"""NCLaw's step by MLS-MPM in a box of walls, with any laws.

    tau = E(F),   P2G with momentum w (m v + (m C - dt V0 4/dx^2 tau) r)     NCLAW-alg2, NCLAW-mls
    v_i = p_i / (m_i + eps) + dt g,   v = sum w v_i,   C = 4/dx^2 sum w v_i r^T
    x += dt v,   F = P((I + dt C) F),   r = x_i - x                          NCLAW-alg1, NCLAW-alg3

The walls take the velocity component that points into them, axis by axis; positions are clipped to
a box (NCLAW-sim). All steps pass complex numbers; conditions look at real parts.
"""

from typing import NamedTuple

import numpy as np


class WalledGrid(NamedTuple):
    """The data of a step besides the body and its laws."""

    dx: float               # [m]
    dt: float               # [s]
    gravity: np.ndarray     # (3,)  [m/s^2]
    eps: float              # added to the masses of nodes [kg]
    walls: tuple            # nodes of an index below the first or above the second stop, per axis
    clip: tuple             # [m]   lowest and highest coordinate of a particle


def spline(z):
    """Return the quadratic B-spline at z, distances in cells."""
    a = z * np.sign(z.real)
    return np.where(a.real < 0.5, 0.75 - a**2, np.where(a.real < 1.5, 0.5 * (1.5 - a) ** 2, 0.0))


def step(laws, state, sizes, grid):
    """Return x, v, C and F after a step from those before it.

    laws: functions E: F (n, 3, 3) -> tau (n, 3, 3) [Pa] and P: F_trial -> F; sizes: m and V0 (n,).
    """
    (x, v, C, F), (m, V0), (dx, dt) = state, sizes, grid[:2]
    low = np.floor(x.real.min(axis=0) / dx) - 1
    count = np.ceil(x.real.max(axis=0) / dx) + 2 - low
    nodes = np.indices(count.astype(int)).reshape(3, -1).T + low
    W = spline(x[:, None] / dx - nodes).prod(axis=2)
    r = dx * nodes - x[:, None]
    A = m[:, None, None] * C - dt * 4.0 / dx**2 * V0[:, None, None] * laws[0](F)
    momentum = W.T @ (m[:, None] * v) + np.einsum("pi,pab,pib->ia", W, A, r)
    v_i = momentum / (m @ W + grid.eps)[:, None] + dt * grid.gravity
    stopped = ((nodes < grid.walls[0]) & (v_i.real < 0.0)
               | (nodes > grid.walls[1]) & (v_i.real > 0.0))
    v_i = np.where(stopped, 0.0, v_i)
    v = W @ v_i
    C = 4.0 / dx**2 * np.einsum("pi,ia,pib->pab", W, v_i, r)
    x = x + dt * v
    for bound, beyond in zip(grid.clip, (np.less, np.greater), strict=True):
        x = np.where(beyond(x.real, bound), bound, x)
    return x, v, C, laws[1](F + dt * C @ F)


def run(laws, state, sizes, grid, steps):
    """Return the states x, v, C and F before the first step and after each (see `step`)."""
    states = [state]
    for _ in range(steps):
        states.append(step(laws, states[-1], sizes, grid))
    return states
