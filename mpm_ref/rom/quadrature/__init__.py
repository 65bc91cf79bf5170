"""Quadratures of a reduced step: which points carry mass, momentum and stress to the grid.

A quadrature is any object with

    X                               (n, d) [m] material points, of which samples are drawn
    dx, degree                      spacing [m] of the grid, degree of its splines
    feather                         mass of a sample on the grid over that of a point
    cloud(map, latent, samples)     the `Cloud` of a step with samples of these indices

`lagrangian` takes the samples' neighbours among the material points, or among points of another
sampling of the body; `eulerian` takes fixed places of the grid's cells, traced back into the body;
`node_centric` chooses nodes first. `stencil_overlap` tells which points share a node.
"""

from typing import NamedTuple

import numpy as np

from ..kinematics import Placed, placed


class Cloud(NamedTuple):
    """Quadrature points of a step."""

    at: Placed
    m: np.ndarray           # (n,) mass [kg]
    V0: np.ndarray          # (n,) volume at rest [m^d]
    said: dict              # what the quadrature says of itself
    samples: Placed | None = None       # the samples, where they are among the points


def carried(body, chosen, map, xhat, samples=None):
    """`Cloud` of the chosen ones of points with X, m and V0, sorted; samples: those of them that
    are, sorted.
    """
    at = placed(map, body.X[chosen], xhat)
    own = None if samples is None else at.of(np.searchsorted(chosen, samples))
    return Cloud(at, body.m[chosen], body.V0[chosen], {"points": len(chosen)}, own)
