"""Parts of Eulerian sub-cells that lie within the body, where its surface cuts them.

LDM-alg4 counts a sub-cell as a whole or not at all, by its midpoint, so that a body which moves
through the grid gains and loses whole sub-cells. Here a sub-cell counts by the share of its volume
within the body, and its point moves to the middle of that part. Both come from a lattice in the
sub-cell, traced back by F of its midpoint, which costs no further evaluation of the map but that of
the points moved. A lattice point counts by its signed distance from the surface, smoothed over the
lattice's spacing: shares are continuous, and exact for a plane across the axes of a body at rest.
"""

from itertools import product
from typing import NamedTuple

import numpy as np

from ..kinematics import Kinematics, evaluate, pull_back

LATTICE = 4         # points of a cut sub-cell per axis


class InnerParts(NamedTuple):
    """The parts of n sub-cells within the body."""

    points: Kinematics      # middles of the parts; of sub-cells without a part, their midpoints
    share: np.ndarray       # (n,) of the volume of a sub-cell that is within the body, 0 to 1


def parts_inside(g, xhat, points, side, distance):
    """Return the `InnerParts` of sub-cells of a side [m] whose midpoints have the `Kinematics`
    points, with det F > 0. distance: X (n, d) -> signed distance from the body's surface at rest
    [m], or a bound that is no larger.
    """
    d, off = points.x.shape[1], distance(points.points)
    share = np.where(off <= 0.0, 1.0, 0.0)
    reach = side * np.sqrt(d) * np.linalg.norm(np.linalg.inv(points.F), axis=(1, 2))
    cut = np.flatnonzero(np.abs(off) < reach)
    F = points.F[cut]
    back = pull_back(F, np.broadcast_to(lattice(d, side), (len(cut), LATTICE**d, d)))
    off = distance((points.points[cut, None] + back).reshape(-1, d)).reshape(len(cut), -1)
    width = side / LATTICE * np.linalg.det(F) ** (-1.0 / d)         # of a lattice cell, at rest
    within = np.clip(0.5 - off / width[:, None], 0.0, 1.0)
    share[cut] = within.mean(axis=1)
    partly = (0.0 < share[cut]) & (share[cut] < 1.0)
    within, back, cut = within[partly], back[partly], cut[partly]
    middle = (within[..., None] * back).sum(axis=1) / within.sum(axis=1)[:, None]
    moved = points.select(np.arange(len(share)))        # a copy
    for old, new in zip(moved, evaluate(g, points.points[cut] + middle, xhat), strict=True):
        old[cut] = new
    return InnerParts(moved, share)


def lattice(d, side):
    """Return the points (LATTICE^d, d) of a sub-cell of a side [m] from its midpoint."""
    steps = (np.arange(LATTICE) + 0.5) / LATTICE - 0.5
    return side * np.array(list(product(steps, repeat=d)))
