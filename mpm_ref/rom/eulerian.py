"""Eulerian quadrature: points at fixed places of the grid's cells, traced back into the body
(LDM-alg4, LDM-eq20, LDM-sec3.2.1.2-cell, X-cross-11).
"""

from itertools import product
from typing import NamedTuple

import numpy as np

from .inverse import guesses, preimages
from .reach import reach

PER_CELL = 2        # quadrature points of a cell per axis, l
FAR = 1.0           # distance of a first guess from the body at which its point is not in it [dx]


class Eulerian(NamedTuple):
    """Midpoints of the sub-cells around the samples, with the mass of the body there."""

    X: np.ndarray       # (n, d) material points, of which samples are drawn [m]
    rho: float          # density at rest [kg/m^d]
    distance: callable  # X (n, d) -> signed distance from the body's surface at rest [m], negative
                        # inside
    seeds: np.ndarray   # (s, d) material points from which, and from the samples, the search for
                        # X begins [m]
    dx: float           # of the grid [m]
    degree: int         # of its splines
    per_cell: int = PER_CELL

    feather = 1e-9      # mass of a sample on the grid over that of a point: no node that samples
                        # read is empty where the points miss the body's edge

    def places(self, x):
        """All quadrature points (n, d) [m] that share a node with samples at x."""
        s = (np.arange(self.per_cell) + 0.5) / self.per_cell
        first = 0.5 * (self.degree - 1)         # points with a base begin so many cells after it
        s = np.sort(s + np.ceil(first - s))
        offsets = np.array(list(product(s, repeat=x.shape[1])))
        cells = reach(x, self.dx, self.degree).cells()
        return (cells[:, None] + offsets).reshape(-1, x.shape[1]) * self.dx

    def cloud(self, map, latent, samples):
        """X, m and V0 of the quadrature points of a step, and what is to be said of them:
        m_q = rho / J_q V_q. A point whose preimage is not in the body carries nothing (LDM-X12),
        nor does one that is far from it at first guess, or where the map is inverted.
        """
        x = self.places(map.place(self.X[samples], latent.xhat))
        start = guesses(map, latent.xhat, x, np.concatenate([self.X[samples], self.seeds]))
        near = self.distance(start) <= FAR * self.dx
        back = preimages(map, latent.xhat, x[near], start[near], self.dx)
        inside = back.found & (self.distance(back.X) <= 0.0)
        J = np.linalg.det(back.F[inside])
        upright = J > 0.0
        V0 = (self.dx / self.per_cell) ** x.shape[1] / J[upright]
        lost = np.sum(~back.found) + np.sum(~upright)
        said = {"points": len(V0), "far": int(np.sum(~near)), "lost": int(lost),
                "outside": int(near.sum() - len(V0) - lost), "iterations": back.iterations}
        return back.X[inside][upright], self.rho * V0, V0, said
