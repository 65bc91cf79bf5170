"""Eulerian quadrature: points at fixed places of the grid's cells, traced back into the body
(LDM-alg4, LDM-eq20, LDM-sec3.2.1.2-cell, X-cross-11).
"""

from itertools import product
from typing import NamedTuple

import numpy as np

from ..kinematics import CLOSE, from_middles, guesses, preimages
from . import Cloud
from .stencil_overlap import reach

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
    close: float = CLOSE    # how near a point's image must be to its place [dx]

    feather = 1e-9      # mass of a sample on the grid over that of a point: no node that samples
                        # read is empty where the points miss the body's edge

    def places(self, x):
        """All quadrature points (n, d) [m] that share a node with samples at x."""
        return self.cells(x).reshape(-1, self.X.shape[1])

    def cells(self, x):
        """The same by cell, (cells, l^d, d)."""
        s = (np.arange(self.per_cell) + 0.5) / self.per_cell
        first = 0.5 * (self.degree - 1)         # points with a base begin so many cells after it
        s = np.sort(s + np.ceil(first - s))
        offsets = np.array(list(product(s, repeat=x.shape[1])))
        return (reach(x, self.dx, self.degree).cells()[:, None] + offsets) * self.dx

    def cloud(self, map, latent, samples):
        """`Cloud` of a step with these samples: m_q = rho / J_q V_q. A point whose preimage is not
        in the body carries nothing (LDM-X12), nor does one that is far from it at first guess, or
        where the map is inverted.
        """
        x, start = self.starts(map, latent.xhat, samples)
        far = self.distance(start) > FAR * self.dx
        back = preimages(map, latent.xhat, x[~far], start[~far], self.dx, self.close)
        J, inside = np.linalg.det(back.at.F), self.distance(back.at.X) <= 0.0
        kept = back.found & inside & (J > 0.0)
        V0 = (self.dx / self.per_cell) ** x.shape[1] / J[kept]
        lost = np.sum(~back.found | inside & (J <= 0.0))
        said = {"points": len(V0), "far": int(far.sum()), "lost": int(lost),
                "outside": int(np.sum(~far) - len(V0) - lost), "iterations": back.iterations}
        return Cloud(back.at.of(kept), self.rho * V0, V0, said)

    def starts(self, map, xhat, samples):
        """All quadrature points x (n, d) around the samples, and first guesses (n, d) of where they
        are from [m]: cell by cell, where a cell's middle is near the body.
        """
        x = self.cells(map.place(self.X[samples], xhat))
        middle, seeds = x.mean(axis=1), np.concatenate([self.X[samples], self.seeds])
        start = guesses(map, xhat, middle, seeds)
        near = self.distance(start) <= (FAR + 0.5 * x.shape[2]**0.5) * self.dx
        start = np.repeat(start[:, None], x.shape[1], axis=1)
        start[near] = from_middles(map, xhat, x[near], start[near, 0], seeds, self.dx)
        return x.reshape(-1, x.shape[2]), start.reshape(-1, x.shape[2])
