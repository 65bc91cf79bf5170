"""Grids with given velocities, and conditions applied to them."""

import numpy as np

from mpm_ref.core.boundary import Collider, Conditions
from mpm_ref.core.levelset import half_space
from mpm_ref.core.state import NONE, Grid

DX = 0.1


def grid_of(v, origin=0, m=1.0, dx=DX):
    """Grid with the velocities v (n1, .., nd, d)."""
    v = np.array(v, dtype=float)
    d = v.shape[-1]
    mass = np.broadcast_to(m, v.shape[:-1]).astype(float)
    return Grid(mass, v, NONE, NONE, np.full(d, origin, dtype=np.int64), dx)


def random_grid(rng, d, n=8, origin=-3):
    """Random velocities; a quarter of the nodes has no mass."""
    m = rng.uniform(0.5, 1.0, d * (n,))
    m[rng.random(m.shape) < 0.25] = 0.0
    return grid_of(rng.normal(size=(*m.shape, d)), origin, m)


def positions(grid):
    """x_i of all nodes, (n1, .., nd, d)."""
    index = np.stack(np.indices(grid.m.shape), axis=-1)
    return (grid.origin + index) * grid.dx


def applied(grid, *colliders, t=1.0, dt=0.1, **conditions):
    """Velocities before and after, and the impulses."""
    before = grid.v.copy()
    J = Conditions(colliders, **conditions).apply(grid, t, dt)
    return before, grid.v, J


def floor(height, d, **options):
    """Half-space below a height along the last axis."""
    up = np.eye(d)[-1]
    return Collider(half_space(height * up, up), **options)


def over(grid, a, box):
    """Nodal values over a box, 0 where the grid has no node."""
    out = np.zeros((*box.shape, *a.shape[grid.m.ndim:]))
    low = np.maximum(grid.origin, box.first)
    high = np.minimum(grid.origin + grid.m.shape, box.first + box.shape)
    here, there = ((slice(*ends) for ends in zip(low - first, high - first, strict=True))
                   for first in (box.first, grid.origin))
    out[tuple(here)] = a[tuple(there)]
    return out
