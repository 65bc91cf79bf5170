"""Eulerian quadrature: points at fixed places of the grid's cells, traced back into the body
(LDM-alg4, LDM-eq20, LDM-sec3.2.1.2-cell, X-cross-11).
"""

from itertools import product
from typing import NamedTuple

import numpy as np

from ..kinematics import CLOSE, evaluate, guesses, guesses_by_cell, preimages
from . import Cloud
from .cut_cells import parts_inside
from .stencil_overlap import stencil_overlap

PER_CELL = 2        # quadrature points of a cell per axis, l
FAR = 1.0           # distance of a first guess from the body at which its point is not in it [dx]
WHOLE, CUT = "whole", "cut"
BOUNDARY_CELLS = (WHOLE, CUT)   # how a sub-cell counts that the body's surface cuts: as a whole or
                                # not at all by its midpoint, or by the part of it in the body


class Eulerian(NamedTuple):
    """Midpoints of the sub-cells around the samples, with the mass of the body there."""

    X: np.ndarray       # (n, d) material points, of which samples are drawn [m]
    rho: float          # density at rest [kg/m^3]
    distance: callable  # X (n, d) -> signed distance from the body's surface at rest [m], negative
                        # inside
    seeds: np.ndarray   # (s, d) material points from which, and from the samples, the search for
                        # X begins [m]
    dx: float           # of the grid [m]
    degree: int         # of its splines
    per_cell: int = PER_CELL
    close: float = CLOSE    # how near a point's image must be to its place [dx]
    boundary_cells: str = WHOLE     # one of `BOUNDARY_CELLS`

    feather = 1e-9      # mass of a sample on the grid over that of a point: no node that samples
                        # read is empty where the points miss the body's edge

    def places(self, x):
        """Return all quadrature points (n, d) [m] that share a node with samples at x."""
        return self.cells(x).reshape(-1, self.X.shape[1])

    def cells(self, x):
        """Return the points of `places` by cell, (cells, l^d, d)."""
        s = (np.arange(self.per_cell) + 0.5) / self.per_cell
        first = 0.5 * (self.degree - 1)         # points with a base begin so many cells after it
        s = np.sort(s + np.ceil(first - s))
        offsets = np.array(list(product(s, repeat=x.shape[1])))
        return (stencil_overlap(x, self.dx, self.degree).cells()[:, None] + offsets) * self.dx

    def cloud(self, g, xhat, samples):
        """Return the `Cloud` of a step with these samples. A point whose preimage is not in the
        body carries nothing (LDM-X12), nor does one that is far from it at first guess, or where
        the map is inverted.
        """
        x, first = self.first_guesses(g, xhat, samples)
        far = self.distance(first) > FAR * self.dx
        back = preimages(g, xhat, x[~far], first[~far], self.dx, self.close)
        points, share = self.parts(g, xhat, back)
        J, inside = np.linalg.det(points.F), share > 0.0
        sound = back.converged & inside & (J > 0.0)
        V0 = share[sound] * (self.dx / self.per_cell) ** x.shape[1] / J[sound]
        lost = np.sum(~back.converged | inside & (J <= 0.0))
        report = {"points": len(V0), "far": int(far.sum()), "lost": int(lost),
                  "outside": int(np.sum(~far) - len(V0) - lost), "iterations": back.iterations}
        return Cloud(points.select(sound), self.rho * V0, V0,
                     evaluate(g, self.X[samples], xhat), report)

    def parts(self, g, xhat, back):
        """Return the `Kinematics` of the parts of sub-cells within the body, and their shares of
        the sub-cells' volume (n,), from the `Preimages` of the midpoints.
        """
        points = back.points
        share = (self.distance(points.points) <= 0.0).astype(float)
        if self.boundary_cells == WHOLE:
            return points, share
        sound = np.flatnonzero(back.converged & (np.linalg.det(points.F) > 0.0))
        side = self.dx / self.per_cell
        parts = parts_inside(g, xhat, points.select(sound), side, self.distance)
        for old, new in zip(points, parts.points, strict=True):
            old[sound] = new
        share[sound] = parts.share
        return points, share

    def first_guesses(self, g, xhat, samples):
        """Return all quadrature points x (n, d) around the samples, and first guesses (n, d) of
        their preimages [m]: cell by cell, where a cell's middle is near the body.
        """
        x = self.cells(g.place(self.X[samples], xhat))
        middle, seeds = x.mean(axis=1), np.concatenate([self.X[samples], self.seeds])
        first = guesses(g, xhat, middle, seeds)
        near = self.distance(first) <= (FAR + 0.5 * x.shape[2]**0.5) * self.dx
        first = np.repeat(first[:, None], x.shape[1], axis=1)
        first[near] = guesses_by_cell(g, xhat, x[near], first[near, 0], seeds, self.dx)
        return x.reshape(-1, x.shape[2]), first.reshape(-1, x.shape[2])
