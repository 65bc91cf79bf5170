"""Which material point is where: X with g(X; xhat) = x, by Newton's method (LDM-alg4, step 3)."""

from typing import NamedTuple

import numpy as np
from scipy.spatial import KDTree

ITERATIONS = 20         # at most
CLOSE = 1e-9            # distance from x at which X counts as found [of the scale]
LONGEST = 1.0           # of a Newton step [of the scale]


class Preimages(NamedTuple):
    """Solutions of g(X; xhat) = x."""

    X: np.ndarray           # (n, d) [m]
    F: np.ndarray           # (n, d, d) dg/dX there
    found: np.ndarray       # (n,) bool: g(X; xhat) is x
    iterations: int


def preimages(map, xhat, x, X, scale):
    """`Preimages` of positions x (n, d) from guesses X (n, d) [m].

    scale [m], the grid's spacing, is the length of the longest step and the unit of what counts as
    found. A point leaves the iteration as soon as it is found.
    """
    X, found, left = X.copy(), np.zeros(len(x), dtype=bool), np.arange(len(x))
    F_last = np.empty((*x.shape, x.shape[1]))
    for k in range(ITERATIONS + 1):
        at, F, _ = map.derivatives(X[left], xhat)
        F_last[left], error = F, x[left] - at
        done = np.sum(error**2, axis=1) <= (CLOSE * scale) ** 2
        found[left[done]] = True
        left, error, F = left[~done], error[~done], F[~done]
        sound = np.abs(np.linalg.det(F)) > np.finfo(float).tiny
        left, error, F = left[sound], error[sound], F[sound]
        if not len(left) or k == ITERATIONS:
            break
        X[left] += shortened(np.linalg.solve(F, error[..., None])[..., 0], LONGEST * scale)
    return Preimages(X, F_last, found, k)


def shortened(step, longest):
    """Steps (n, d) cut to a length."""
    length = np.linalg.norm(step, axis=1, keepdims=True)
    return step * np.minimum(1.0, longest / np.maximum(length, longest))


def guesses(map, xhat, x, seeds):
    """First guesses for `preimages`: X_s + F_s^-1 (x - x_s) from the nearest of material points
    `seeds` (s, d) that are not inverted. Raises ValueError where all are.
    """
    at, F, _ = map.derivatives(seeds, xhat)
    sound = np.linalg.det(F) > 0.0
    if not sound.any():
        raise ValueError(f"all {len(seeds)} material points asked are inverted (det F <= 0): the "
                         "map gives no body at these latent coordinates")
    seeds, at, F = seeds[sound], at[sound], F[sound]
    _, near = KDTree(at).query(x)
    return seeds[near] + np.linalg.solve(F[near], (x - at[near])[..., None])[..., 0]
