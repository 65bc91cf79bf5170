"""Kinematics of points on a deformation map, and its inverse.

`placed` evaluates position x, deformation gradient F and dg/dxhat of material points X together
(LDM-eq14 to LDM-eq16). `preimages` finds the material point X with g(X; xhat) = x by Newton's
method (LDM-alg4, step 3), from first guesses of `guesses` or `from_middles`.
"""

from typing import NamedTuple

import numpy as np
from scipy.spatial import KDTree

ITERATIONS = 20         # at most
CLOSE = 1e-9            # distance from x at which X counts as found [of the scale] ...
ROUGH = 1e-2            # ... where a guess is all that is wanted
LONGEST = 1.0           # of a Newton step [of the scale]


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


def placed(map, X, xhat):
    """`Placed` points X (n, d) at latent coordinates."""
    return Placed(X, *map.derivatives(X, xhat))


class Preimages(NamedTuple):
    """Solutions of g(X; xhat) = x."""

    at: Placed              # of the last X tried
    found: np.ndarray       # (n,) bool: g(X; xhat) is x
    iterations: int


def preimages(map, xhat, x, X, scale, close=CLOSE):
    """`Preimages` of positions x (n, d) from guesses X (n, d) [m].

    scale [m], the grid's spacing, is the length of the longest step and the unit of what counts as
    close. A point leaves the iteration as soon as it is found; what is known of it is of the X that
    was found, not of the x that was asked for.
    """
    at, left = placed(map, X.copy(), xhat), np.arange(len(x))
    found = np.zeros(len(x), dtype=bool)
    for k in range(ITERATIONS + 1):
        error = x[left] - at.x[left]
        done = np.sum(error**2, axis=1) <= (close * scale) ** 2
        found[left[done]] = True
        left, error = left[~done], error[~done]
        sound = np.abs(np.linalg.det(at.F[left])) > np.finfo(float).tiny
        left, error = left[sound], error[sound]
        if not len(left) or k == ITERATIONS:
            break
        at.X[left] += shortened(back(at.F[left], error[:, None])[:, 0], LONGEST * scale)
        for known, new in zip(at, placed(map, at.X[left], xhat), strict=True):
            known[left] = new
    return Preimages(at, found, k)


def back(F, steps):
    """F^-1 (n, d, d) times steps (n, k, d), so many for each."""
    return np.linalg.solve(F, steps.transpose(0, 2, 1)).transpose(0, 2, 1)


def shortened(step, longest):
    """Steps (n, d) cut to a length."""
    length = np.linalg.norm(step, axis=1, keepdims=True)
    return step * np.minimum(1.0, longest / np.maximum(length, longest))


def guesses(map, xhat, x, seeds):
    """First guesses for `preimages`: X_s + F_s^-1 (x - x_s) from the nearest of material points
    `seeds` (s, d) that are not inverted and somewhere. Raises `NoBody` where none is.
    """
    at, F, _ = map.derivatives(seeds, xhat)
    sound = (np.linalg.det(F) > 0.0) & np.isfinite(at).all(axis=1)
    if not sound.any():
        raise NoBody(f"all {len(seeds)} material points asked are inverted (det F <= 0) or "
                     "nowhere: the map gives no body at these latent coordinates")
    seeds, at, F = seeds[sound], at[sound], F[sound]
    _, near = KDTree(at).query(x)
    return seeds[near] + back(F[near], (x - at[near])[:, None])[:, 0]


def from_middles(map, xhat, x, X, seeds, scale):
    """First guesses (k, l, d) for positions x (k, l, d) in k cells, from guesses X (k, d) of the
    cells' middles: these are traced back, roughly, and their F carries the rest. Where that fails,
    those of `guesses`.
    """
    middle = preimages(map, xhat, x.mean(axis=1), X, scale, ROUGH)
    sound = middle.found & (np.linalg.det(middle.at.F) > 0.0)
    at, found = middle.at.of(sound), np.empty(x.shape)
    found[sound] = at.X[:, None] + back(at.F, x[sound] - at.x[:, None])
    found[~sound] = guesses(map, xhat, x[~sound].reshape(-1, x.shape[2]), seeds).reshape(
        found[~sound].shape)
    return found
