"""Adjoint of the grid update: bars of nodal velocities become bars of mass, momentum and force.

    v_i = (m_i v_i + dt f_i)/(m_i + eps) + dt g        on nodes that have mass (see `grid.update`)

Bars of nodes are kept in a `Grid`. Which nodes have mass is not differentiated.
"""

from typing import NamedTuple

import numpy as np

from ..grid import flattened
from ..jit import CHUNKS, chunk, kernel, parallel, prange


class Update(NamedTuple):
    """The options of `grid.update`."""

    dt: float           # [s]
    eps: float          # [kg]
    on_empty: bool


@kernel
def update_bars(nodes, bars, gravity, how, sums, bounds):
    """With v the velocity after the update and v' its bar, for one chunk of nodes:

    (m v) = v'/(m + eps),   m = -v' . (v - dt g)/(m + eps),   g += dt v'
    """
    for i in range(bounds[0], bounds[1]):
        full = nodes.m[i] > 0.0
        scale = 1.0 / (nodes.m[i] + how.eps) if full else 0.0
        for a in range(len(gravity)):
            v = bars.v[i, a]
            if full or how.on_empty:
                sums[a] += how.dt * v
            if full:
                bars.m[i] -= v * (nodes.v[i, a] - how.dt * gravity[a]) * scale
            bars.v[i, a] = v * scale


@kernel
def update_flip_bars(nodes, bars, how, bounds):
    """After `update_bars`, where forces and old velocities are carried separately (FLIP):

    f = dt v'/m,   (m v) += v_old'/m,   m -= v_old' . v_old/m
    """
    for i in range(bounds[0], bounds[1]):
        for a in range(nodes.v.shape[1]):
            bars.f[i, a] = how.dt * bars.v[i, a]
            if nodes.m[i] > 0.0:
                old = bars.v_old[i, a] / nodes.m[i]
                bars.v[i, a] += old
                bars.m[i] -= old * nodes.v_old[i, a]


@parallel
def _update_all(nodes, bars, gravity, how, sums):
    for c in prange(CHUNKS):
        update_bars(nodes, bars, gravity, how, sums[c], chunk(c, len(nodes.m)))


@parallel
def _update_flip_all(nodes, bars, how):
    for c in prange(CHUNKS):
        update_flip_bars(nodes, bars, how, chunk(c, len(nodes.m)))


def update_adjoint(grid, bars, gravity, how):
    """Turn the bars of v and v_old into those of m, momentum (in bars.v) and f; returns that of
    gravity (d,).

    grid holds m and the velocities after the update, before conditions; how is an `Update`.
    """
    nodes, flat, gravity = flattened(grid), flattened(bars), np.asarray(gravity, dtype=float)
    sums = np.zeros((CHUNKS, len(gravity)))
    _update_all(nodes, flat, gravity, how, sums)
    if grid.f.ndim > 1:
        _update_flip_all(nodes, flat, how)
    return sums.sum(axis=0)
