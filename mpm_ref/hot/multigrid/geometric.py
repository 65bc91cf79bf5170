"""Hessians on grids of 2, 4, ... times the spacing, from all particles: geometric multigrid.

The comparator of HOT's Galerkin products (HOT-methods, LBFGS-GMG): on level l the nodes are the
multiples of 2^l dx that the particles reach with the kernel of the finest level. Masses are
scattered anew, conditions tested at the level's own nodes, and the blocks

    H_ij = m_i delta_ij I + sum_p dw_ip . C_p . dw_jp

summed over all particles with the differentials C_p of the finest level. A node's coarser
neighbours carry mass if it does: what reaches the node reaches them.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ..assembly import Pattern, assembled, pattern_of
from ..potential import box_of
from ..quadrature import Modes, order_of, sites_of
from ..system import Unknowns, constrained


class Space(NamedTuple):
    """One coarser level; per body, `sites` and the places of its particles on the finest level."""

    unknowns: Unknowns
    sites: tuple
    places: tuple           # of arrays (N,)
    pattern: Pattern


class Geometric:
    """Coarser levels of a `Potential`; unknowns_at(level) are those at 2^level dx, with their
    conditions. What does not depend on the increment is kept from one matrix to the next.
    """

    def __init__(self, potential, unknowns_at):
        self.potential, self.unknowns_at = potential, unknowns_at
        self.spaces = []

    def matrices(self, modes, levels):
        """(B H B, node indices) of the levels 1 .. levels - 1, from the `Modes` of every body.

        Fewer where a level would have as many nodes as the one before.
        """
        found, n = [], len(self.potential.unknowns.m)
        for level in range(1, levels):
            space = self.space(level)
            if len(space.unknowns.m) >= n:
                break
            n = len(space.unknowns.m)
            found.append((matrix(space, modes), space.unknowns.index))
        return found

    def space(self, level):
        """`Space` of a level >= 1."""
        while len(self.spaces) < level:
            unknowns = self.unknowns_at(len(self.spaces) + 1)
            self.spaces.append(space_of(self.potential, unknowns))
        return self.spaces[level - 1]


def space_of(potential, unknowns):
    """`Space` of a potential's particles on other nodes."""
    stencil, box = potential.stencil, box_of(unknowns)
    sites = tuple(sites_of(body, box, stencil) for body in potential.bodies)
    places = tuple(places_of(body, (potential.box, box), stencil) for body in potential.bodies)
    return Space(unknowns, sites, places, pattern_of(unknowns.number, len(stencil) - 1))


def places_of(body, boxes, stencil):
    """Where in the order of the first box's cells the particles in that of the second stand."""
    before, after = (order_of(body, box, stencil) for box in boxes)
    rank = np.empty(len(body.particles.x), dtype=np.int64)
    rank[before] = np.arange(len(before))
    return rank[after]


def matrix(space, modes):
    """B H B of a level as a bsr_array [kg]."""
    sorted_modes = (Modes(*(a[at] for a in of_body)) for of_body, at in zip(modes, space.places))
    bodies = tuple(zip(space.sites, sorted_modes))
    return constrained(assembled(bodies, space.unknowns, space.pattern), space.unknowns.B)


def conditions_at(conditions, factor):
    """`Conditions` for a grid of `factor` times the spacing: walls are counted in its nodes."""
    walls = conditions.walls
    if walls is None:
        return conditions
    low = tuple(k if k is None else -(-k // factor) for k in walls.low)
    high = tuple(k if k is None else k // factor for k in walls.high)
    return replace(conditions, walls=replace(walls, low=low, high=high))
