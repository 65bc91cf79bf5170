"""Kinematics of points on a deformation map, and its inverse.

`evaluate` gives position x, deformation gradient F and dg/dxhat of material points together
(LDM-eq14 to LDM-eq16). `preimages` finds the material point X with g(X; xhat) = x by Newton's
method (LDM-alg4, step 3), from first guesses of `guesses` or `guesses_by_cell`.
"""

from typing import NamedTuple

import numpy as np
from scipy.spatial import KDTree

ITERATIONS = 20         # at most
CLOSE = 1e-9            # distance from x at which X counts as its preimage [of the scale] ...
ROUGH = 1e-2            # ... where a guess is all that is wanted
LONGEST = 1.0           # of a Newton step [of the scale]


class NoBody(ValueError):
    """The field gives no body at the latent coordinates of a reduced run."""


class Kinematics(NamedTuple):
    """n points at some latent coordinates (LDM-eq14 to LDM-eq16)."""

    points: np.ndarray      # (n, d) at rest [m], or (n,) numbers of points that the field knows
    x: np.ndarray           # (n, d) position [m]
    F: np.ndarray | None = None     # (n, d, d) deformation gradient; None: not evaluated
    G: np.ndarray | None = None     # (n, d, r) dg/dxhat [m]; None: not evaluated

    def select(self, chosen):
        """Return those of some numbers, or of a mask (n,)."""
        return Kinematics(*(None if a is None else a[chosen] for a in self))


def evaluate(field, points, xhat):
    """Return the `Kinematics` of points at latent coordinates xhat (r,)."""
    return Kinematics(points, *field.derivatives(points, xhat))


class Preimages(NamedTuple):
    """Solutions of g(X; xhat) = x."""

    points: Kinematics      # of the last X tried
    converged: np.ndarray   # (n,) bool: g(X; xhat) is x
    iterations: int


def preimages(g, xhat, x, X, scale, close=CLOSE):
    """Return the `Preimages` of positions x (n, d) from guesses X (n, d) [m].

    scale [m], the grid's spacing, is the length of the longest step and the unit of what counts as
    close. A point leaves the iteration as soon as it has converged; its kinematics are those of the
    X that was reached, not of the x that was asked for.
    """
    at, left = evaluate(g, X.copy(), xhat), np.arange(len(x))
    converged = np.zeros(len(x), dtype=bool)
    for k in range(ITERATIONS + 1):
        error = x[left] - at.x[left]
        done = np.sum(error**2, axis=1) <= (close * scale) ** 2
        converged[left[done]] = True
        left, error = left[~done], error[~done]
        sound = np.abs(np.linalg.det(at.F[left])) > np.finfo(float).tiny
        left, error = left[sound], error[sound]
        if not len(left) or k == ITERATIONS:
            break
        at.points[left] += shorten(pull_back(at.F[left], error[:, None])[:, 0], LONGEST * scale)
        for old, new in zip(at, evaluate(g, at.points[left], xhat), strict=True):
            old[left] = new
    return Preimages(at, converged, k)


def pull_back(F, steps):
    """Return F^-1 (n, d, d) times steps (n, k, d)."""
    return np.linalg.solve(F, steps.transpose(0, 2, 1)).transpose(0, 2, 1)


def shorten(step, longest):
    """Return steps (n, d) cut to a length."""
    length = np.linalg.norm(step, axis=1, keepdims=True)
    return step * np.minimum(1.0, longest / np.maximum(length, longest))


def guesses(g, xhat, x, seeds):
    """Return first guesses for `preimages`: X_s + F_s^-1 (x - x_s) from the nearest of material
    points `seeds` (s, d) that are finite and not inverted. Raises `NoBody` where none is.
    """
    at, F, _ = g.derivatives(seeds, xhat)
    sound = (np.linalg.det(F) > 0.0) & np.isfinite(at).all(axis=1)
    if not sound.any():
        raise NoBody(f"all {len(seeds)} material points asked are inverted (det F <= 0) or "
                     "nowhere: the map gives no body at these latent coordinates")
    seeds, at, F = seeds[sound], at[sound], F[sound]
    _, near = KDTree(at).query(x)
    return seeds[near] + pull_back(F[near], (x - at[near])[:, None])[:, 0]


def guesses_by_cell(g, xhat, x, X, seeds, scale):
    """Return first guesses (k, l, d) for positions x (k, l, d) in k cells, from guesses X (k, d) of
    the cells' middles: these are traced back, roughly, and their F carries the rest. Where that
    fails, those of `guesses`.
    """
    middle = preimages(g, xhat, x.mean(axis=1), X, scale, ROUGH)
    sound = middle.converged & (np.linalg.det(middle.points.F) > 0.0)
    at, first = middle.points.select(sound), np.empty(x.shape)
    first[sound] = at.points[:, None] + pull_back(at.F, x[sound] - at.x[:, None])
    first[~sound] = guesses(g, xhat, x[~sound].reshape(-1, x.shape[2]), seeds).reshape(
        first[~sound].shape)
    return first
