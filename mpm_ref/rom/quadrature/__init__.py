"""Quadratures of a reduced step: the points that carry mass, momentum and stress to the grid.

`lagrangian` takes the samples' neighbours among the material points, or among points of another
sampling of the body; `eulerian` takes fixed places of the grid's cells, traced back into the body;
`node_centric` chooses nodes first. `stencil_overlap` finds the points that share a node.
"""

from typing import NamedTuple, Protocol

import numpy as np

from ..kinematics import Kinematics


class Cloud(NamedTuple):
    """Quadrature points of a step, and its samples."""

    points: Kinematics
    m: np.ndarray           # (n,) mass [kg]
    V0: np.ndarray          # (n,) volume at rest [m^d]
    samples: Kinematics
    report: dict            # "points": n, and further counts of the quadrature
    numbers: np.ndarray | None = None   # (n,) of the points, sorted, where they are material ones


class Quadrature(Protocol):
    """The quadrature of a reduced step."""

    dx: float               # spacing of the grid [m]
    degree: int             # of its splines
    feather: float          # mass of a sample on the grid over that of a point; 0 where samples are
                            # quadrature points themselves

    def cloud(self, field, xhat, samples):
        """Return the `Cloud` of a step at latent coordinates xhat (r,) with the samples of these
        numbers (m,), sorted.
        """
