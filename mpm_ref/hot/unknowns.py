"""The unknowns of a step: the nodes that have mass, numbered, and the increments they may take."""

from typing import NamedTuple

import numpy as np


class Unknowns(NamedTuple):
    """n nodes in d dimensions; their numbers run along the grid, its first axis slowest.

    The increments dv that the conditions admit are dv0 + B w for any w (n, d).
    """

    number: np.ndarray    # (n1, .., nd)  number of each grid node; -1 without mass
    index: np.ndarray     # (n, d)        node index: the position is index * dx
    m: np.ndarray         # (n,)          mass [kg]
    v: np.ndarray         # (n, d)        velocity at the start of the step [m/s]
    B: np.ndarray         # (n, d, d)     symmetric projector on what the conditions leave free
    dv0: np.ndarray       # (n, d)        increment that the conditions ask for [m/s]
    origin: np.ndarray    # (d,)          index of the grid's first node
    dx: float             #               grid spacing [m]


def unknowns_of(grid):
    """`Unknowns` of a grid that holds mass and momentum, with no conditions."""
    d = grid.m.ndim
    flat = np.flatnonzero(grid.m.reshape(-1) > 0.0)
    number = np.full(grid.m.size, -1, dtype=np.int32)
    number[flat] = np.arange(len(flat))
    index = np.stack(np.unravel_index(flat, grid.m.shape), axis=1) + grid.origin
    m = grid.m.reshape(-1)[flat]
    v = grid.v.reshape(-1, d)[flat] / m[:, None]
    B = np.tile(np.eye(d), (len(flat), 1, 1))
    number = number.reshape(grid.m.shape)
    return Unknowns(number, index, m, v, B, np.zeros_like(v), grid.origin, float(grid.dx))


def free_part(unknowns, u):
    """B u of a nodal field (n, d)."""
    return np.einsum("nab,nb->na", unknowns.B, u)
