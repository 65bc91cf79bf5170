"""Samples M and neighbours N that are found once, for all times and parameters (LDMW-sets)."""

from typing import NamedTuple

import numpy as np

from .latent import at_start
from .placed import carried


class Neighbours(NamedTuple):
    """Lagrangian quadrature on a set of material points that does not change.

    It is that of `lagrangian`, to the last bit, as long as no other point comes to share a node
    with a sample: nothing tells when one does, and then the sample's nodes lack its mass.
    """

    X: np.ndarray           # (n, d) of all material points, at rest [m]
    m: np.ndarray           # (n,)   mass [kg]
    V0: np.ndarray          # (n,)   volume at rest [m^d]
    dx: float               # of the grid [m]
    degree: int             # of its splines
    samples: np.ndarray     # (s,) indices of M, sorted
    around: np.ndarray      # (k,) indices of N, sorted; none is in M

    feather = 0.0           # mass of a sample on the grid beyond its own

    def cloud(self, map, latent, samples):
        """`Cloud` of the points of M and N. Raises ValueError for a sample that is not in M."""
        foreign = np.setdiff1d(samples, self.samples)
        if len(foreign):
            raise ValueError(f"sample {foreign[0]} is not among the {len(self.samples)} that "
                             "neighbours were found for: sample among those")
        chosen = np.union1d(self.samples, self.around)
        return carried(self, chosen, map, latent.xhat, samples)


def neighbours(lagrangian, map, latents, samples):
    """`Neighbours` of samples of a `Lagrangian` quadrature: the points that share a node with one
    at any of the latent coordinates (.., r), such as those of all training snapshots.

    Raises ValueError where there are no latent coordinates.
    """
    samples, latents = np.unique(samples), np.reshape(latents, (-1, map.r))
    if not len(latents):
        raise ValueError("no latent coordinates to find neighbours at: expected those of at least "
                         "one state")
    near = [lagrangian.support(map, at_start(xhat), samples) for xhat in latents]
    around = np.setdiff1d(np.unique(np.concatenate(near)), samples)
    return Neighbours(lagrangian.X, lagrangian.m, lagrangian.V0, lagrangian.dx, lagrangian.degree,
                      samples, around)
