"""Hessians on grids of 2, 4, ... times the spacing, from all particles: geometric multigrid.

The comparator of HOT's Galerkin products (HOT-methods, LBFGS-GMG): on level l the nodes are the
multiples of 2^l dx that the particles reach with the kernel of the finest level. Masses are
scattered anew, conditions tested at the level's own nodes, and the blocks

    H_ij = m_i delta_ij I + sum_p dw_ip . C_p . dw_jp

summed over all particles with the differentials C_p of the finest level, without friction. A
node's coarser neighbours carry mass if it does: what reaches the node reaches them.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ..assembly import Pattern, assembled, pattern_of
from ..potential import box_of
from ..quadrature import StressModes, cell_order, quadrature_points
from ..system import Unknowns, constrained


class CoarseGrid(NamedTuple):
    """One coarser level; for each body its points and their ranks on the finest level."""

    unknowns: Unknowns
    points: tuple
    order: tuple            # of arrays (N,)
    pattern: Pattern
    stencil: tuple


class CoarseGrids:
    """Coarser levels of a `Potential`; coarse_unknowns(level) are those at 2^level dx, with their
    conditions. Data that do not depend on the increment are reused from one matrix to the next.
    """

    def __init__(self, potential, coarse_unknowns):
        self.potential, self.coarse_unknowns = potential, coarse_unknowns
        self.grids = []

    def matrices(self, modes, levels):
        """Return [(B H B, node indices)] of the levels 1 .. levels - 1.

        There are fewer where a level would have as many nodes as the one before.

        modes has the `StressModes` of every body.
        """
        matrices, n = [], len(self.potential.unknowns.m)
        for level in range(1, levels):
            grid = self.grid(level)
            if len(grid.unknowns.m) >= n:
                break
            n = len(grid.unknowns.m)
            matrices.append((coarse_matrix(grid, modes), grid.unknowns.index))
        return matrices

    def grid(self, level):
        """`CoarseGrid` of a level >= 1."""
        while len(self.grids) < level:
            unknowns = self.coarse_unknowns(len(self.grids) + 1)
            self.grids.append(coarse_grid(self.potential, unknowns))
        return self.grids[level - 1]


def coarse_grid(potential, unknowns):
    """`CoarseGrid` of a potential's particles on other nodes."""
    stencil, box = potential.stencil, box_of(unknowns)
    points = tuple(quadrature_points(body, box, stencil) for body in potential.bodies)
    order = tuple(point_permutation(body, (potential.box, box), stencil)
                  for body in potential.bodies)
    pattern = pattern_of(unknowns.number, len(stencil) - 1)
    return CoarseGrid(unknowns, points, order, pattern, stencil)


def point_permutation(body, boxes, stencil):
    """Ranks (N,) of the particles by the first box's cells, listed by the second box's cells."""
    before, after = (cell_order(body, box, stencil) for box in boxes)
    rank = np.empty(len(body.particles.x), dtype=np.int64)
    rank[before] = np.arange(len(before))
    return rank[after]


def coarse_matrix(grid, modes):
    """B H B of a level as a bsr_array [kg]."""
    sorted_modes = (StressModes(*(a[order] for a in of_body))
                    for of_body, order in zip(modes, grid.order))
    bodies = tuple(zip(grid.points, sorted_modes))
    H = assembled(bodies, grid.unknowns, grid.pattern, grid.stencil)
    return constrained(H, grid.unknowns.B)


def coarse_conditions(conditions, factor):
    """`Conditions` for a grid of `factor` times the spacing: walls are counted in its nodes."""
    walls = conditions.walls
    if walls is None:
        return conditions
    low = tuple(k if k is None else -(-k // factor) for k in walls.low)
    high = tuple(k if k is None else k // factor for k in walls.high)
    return replace(conditions, walls=replace(walls, low=low, high=high))
