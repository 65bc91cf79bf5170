"""Where material points are, with what follows from the same evaluation of the map."""

from typing import NamedTuple

import numpy as np


class NoBody(ValueError):
    """The map gives no body at the latent coordinates of a reduced run."""


class Placed(NamedTuple):
    """n points at some latent coordinates (LDM-eq14 to LDM-eq16)."""

    X: np.ndarray           # (n, d)    at rest [m]
    x: np.ndarray           # (n, d)    position [m]
    F: np.ndarray           # (n, d, d) deformation gradient
    G: np.ndarray           # (n, d, r) dg/dxhat [m]

    def of(self, chosen):
        """Those of some numbers, or of a mask (n,)."""
        return Placed(*(a[chosen] for a in self))


class Cloud(NamedTuple):
    """Quadrature points of a step."""

    at: Placed
    m: np.ndarray           # (n,) mass [kg]
    V0: np.ndarray          # (n,) volume at rest [m^d]
    said: dict              # what the quadrature says of itself
    samples: Placed | None = None       # the samples, where they are among the points


def placed(map, X, xhat):
    """`Placed` points X (n, d) at latent coordinates."""
    return Placed(X, *map.derivatives(X, xhat))


def carried(body, chosen, map, xhat, samples=None):
    """`Cloud` of the chosen ones of points with X, m and V0, sorted; samples: those of them that
    are, sorted.
    """
    at = placed(map, body.X[chosen], xhat)
    own = None if samples is None else at.of(np.searchsorted(chosen, samples))
    return Cloud(at, body.m[chosen], body.V0[chosen], {"points": len(chosen)}, own)
