"""LDM's Eulerian quadrature: midpoints of sub-cells around samples, traced back into the body.

    g(X^q; xhat) = x^q,    V^q = (dx / l)^3,    m^q = rho_0 V^q / J^q,    J = det dg/dX   LDM-alg4

Sub-cells are those that share a node of a quadratic spline with a sample (LDM-sec3.2.1.2-cell). A
midpoint counts where it has a preimage inside the body at rest (LDM-X12). The map is any function
that passes complex numbers; its gradient is a complex step, its inverse that of scipy.optimize.
"""

from typing import NamedTuple

import numpy as np
from scipy.optimize import root

TINY = 1e-30            # complex step
TOLERANCE = 1e-13       # of preimages, relative
CLOSE = 1e-12           # distance |g(X) - x| at which a preimage counts, in spacings of the grid


class TracedPoints(NamedTuple):
    """Quadrature points inside the body, in the order of their places."""

    x: np.ndarray           # (n, 3)        places in the grid [m]
    X: np.ndarray           # (n, 3)        preimages [m]
    F: np.ndarray           # (n, 3, 3)     dg/dX at these
    m: np.ndarray           # (n,)          masses [kg]
    V0: np.ndarray          # (n,)          volumes at rest [m^3]


def stencils(x, nodes, dx):
    """Return whether nodes (k, 3), by index, are in the stencils of points x (n, 3) [m], (n, k)."""
    return (np.abs(x[:, None] / dx - nodes) < 1.5).all(axis=-1)


def places(samples, dx, per_cell):
    """Return all midpoints (n, 3) [m] of sub-cells that share a node with samples (m, 3) [m]."""
    low, high = np.floor(samples.min(axis=0) / dx) - 4, np.ceil(samples.max(axis=0) / dx) + 4
    nodes = np.indices((high - low + 1).astype(int)).reshape(3, -1).T + low
    active = nodes[stencils(samples, nodes, dx).any(axis=0)]
    cells = np.unique((active[:, None] + np.indices((4, 4, 4)).reshape(3, -1).T - 2).reshape(-1, 3),
                      axis=0)
    inner = (np.indices((per_cell,) * 3).reshape(3, -1).T + 0.5) / per_cell
    x = dx * (cells[:, None] + inner).reshape(-1, 3)
    return x[stencils(x, active, dx).any(axis=1)]


def gradient(g, X):
    """Return F = dg/dX (n, 3, 3) at X (n, 3)."""
    return np.stack([g(X + step).imag / TINY for step in 1j * TINY * np.eye(3)], axis=-1)


def preimage(g, x, guess, dx):
    """Return X (3,) with g(X) = x (3,), searched from a guess, or None without one [m]."""
    solution = root(lambda X: g(X[None])[0] - x, guess, tol=TOLERANCE)
    return solution.x if np.abs(solution.fun).max() < CLOSE * dx else None


def quadrature(g, material, is_inside, dx, per_cell=2):
    """Return the `TracedPoints` around samples.

    g: X (n, 3) -> x (n, 3) [m]; material: samples at rest (m, 3) [m], points of the body to search
    from (k, 3) [m], and the density at rest [kg/m^3]; is_inside: X (3,) -> bool; dx [m].
    """
    samples, seeds, rho = material
    images, traced = g(seeds), []
    for x in places(g(samples), dx, per_cell):
        guess = seeds[np.argmin(np.linalg.norm(images - x, axis=1))]
        X = preimage(g, x, guess, dx)
        if X is not None and is_inside(X):
            traced.append((x, X))
    x, X = (np.array(a) for a in zip(*traced, strict=True))
    F = gradient(g, X)
    V0 = (dx / per_cell) ** 3 / np.linalg.det(F)
    order = np.lexsort(np.rint(x / dx * 2 * per_cell).T)
    return TracedPoints(*(a[order] for a in (x, X, F, rho * V0, V0)))
