"""Incomplete and noisy observations of a run, and the states that a training restarts from.

Frames may be missing, points too; positions may have errors. The rest of a state is either given,
as in NCLaw, or estimated from positions:

    x, v    at an observed point, a parabola through positions of WINDOW frames around (of time)
    F, L    at each point, the affine maps from x(0) to x and to v that fit its NEAR nearest
            observed points by least squares; x and v too at a point that is not observed
    C       L F^-1: as MLS-MPM has it, the velocity gradient

F is the whole deformation then, of which a body that flows keeps a part alone.
"""

from typing import NamedTuple

import numpy as np
from scipy.spatial import KDTree

from mpm_ref.trajectories import Observed

OFF = 0.1           # size of an outlier [m]
WINDOW = 11         # frames of a parabola in time
NEAR = 14           # points of an affine map


class Observation(NamedTuple):
    """Frames, points and errors of an observation of a run."""

    every: int = 1              # steps between frames
    share: float = 1.0          # of the points
    noise: float = 0.0          # standard deviation of positions along each axis [m]
    outliers: float = 0.0       # share of the positions that are OFF away
    gap: int = 0                # steps in the middle of the run without a frame
    positions: bool = False     # whether states are estimated from positions alone

    @property
    def complete(self):
        """Return whether nothing is missing, and no position has an error."""
        return self == Observation()


def frames(observation, steps):
    """Return the observed time levels (m,) of a run of `steps` steps; the first is among them."""
    levels = np.arange(0, steps + 1, observation.every)
    distance = np.abs(levels - steps / 2)
    return levels[(distance >= observation.gap / 2) | (levels == 0)]


def points(observation, n, rng):
    """Return a mask (n,) of the observed points; at least one."""
    mask = np.zeros(n, dtype=bool)
    mask[rng.permutation(n)[:max(round(observation.share * n), 1)]] = True
    return mask


def weights(levels, mask, steps):
    """Return the weights (steps + 1, n) of squared errors: equal where points are observed, 1 in
    the mean over the levels after the first.
    """
    counts = np.zeros((steps + 1, len(mask)))
    counts[np.ix_(levels, mask)] = 1.0
    return counts / counts[1:].mean()


def noisy(x, observation, rng):
    """Return positions (m, n, d) with noise and outliers; those of the first frame are exact."""
    off = observation.noise * rng.normal(size=x.shape)
    direction = rng.normal(size=x.shape)
    far = rng.random(x.shape[:2]) < observation.outliers
    off += OFF * far[..., None] * direction / np.linalg.norm(direction, axis=2, keepdims=True)
    off[0] = 0.0
    return x + off


def observe(observation, true, dt, seed=0):
    """Return (`Observed` to train on, weights of its squared errors) of a full run, `Observed`, of
    steps dt [s]. Between frames it is NaN.
    """
    rng, steps = np.random.default_rng(seed), len(true.x) - 1
    levels, mask = frames(observation, steps), points(observation, true.x.shape[1], rng)
    x = noisy(true.x[levels], observation, rng)
    if observation.positions:
        rows = from_positions(x, mask, levels * dt, true.v[0])
    else:
        rows = Observed(np.where(mask[:, None], x, true.x[levels]),
                        *(a[levels] for a in true[1:]))
    run = Observed(*(np.full_like(a, np.nan) for a in true))
    for a, row in zip(run, rows, strict=True):
        a[levels] = row
    return run, weights(levels, mask, steps)


def from_positions(x, mask, t, v0):
    """Return `Observed` of frames at times t (m,) from positions x (m, n, d), of which those of
    points of a mask (n,) are read, but for the first frame, which is complete, as its velocities v0
    (n, d) are.
    """
    X = x[0]
    smooth, v = parabolas(x[:, mask], t, v0[mask])
    near = KDTree(X[mask]).query(X, min(NEAR, int(mask.sum())))[1]
    places, F = affine(X[mask][near], X, smooth[:, near])
    moving, L = affine(X[mask][near], X, v[:, near])
    places[:, mask], moving[:, mask] = smooth, v
    places[0], moving[0] = X, v0
    return Observed(places, moving, L @ np.linalg.inv(F), F)


def parabolas(x, t, v0):
    """Return positions and velocities (m, n, d) of parabolas through WINDOW frames around each, of
    each stretch of frames that are evenly apart; the first ones are exact.
    """
    smooth, v = x.copy(), np.zeros_like(x)
    breaks = np.flatnonzero(np.diff(t) > 1.5 * (t[1] - t[0])) + 1
    for part in np.split(np.arange(len(t)), breaks):
        width = min(WINDOW, len(part) - (len(part) + 1) % 2)
        for k in part:
            begin = np.clip(k - width // 2, part[0], part[-1] + 1 - width)
            around = slice(begin, begin + width)
            value, *slopes = np.linalg.pinv(np.vander(t[around] - t[k], min(3, width), True))
            smooth[k] = np.tensordot(value, x[around], 1)
            if slopes:
                v[k] = np.tensordot(slopes[0], x[around], 1)
    smooth[0], v[0] = x[0], v0
    return smooth, v


def affine(Y, X, y):
    """Return values (m, n, d) at X (n, d), and gradients (m, n, d, d), of the affine maps that fit
    values y (m, n, k, d) at Y (n, k, d) best.
    """
    ones = np.ones((*Y.shape[:2], 1))
    basis = np.concatenate([ones, Y - X[:, None]], axis=2)
    fit = np.einsum("pik,mpkd->mpid", np.linalg.pinv(basis), y)
    return fit[:, :, 0], np.swapaxes(fit[:, :, 1:], 2, 3)
