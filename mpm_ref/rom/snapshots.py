"""What a reduced model learns from: full-order runs of one body, all points at all steps."""

from typing import NamedTuple

import numpy as np

from .decoder import Units

STILL = 1e-12       # of the body's span: standard deviation of a component that does not vary


class Snapshots(NamedTuple):
    """s runs of n points over k steps; time levels 0 .. k, points in the body's own order."""

    X: np.ndarray       # (n, d)                at rest [m]
    m: np.ndarray       # (n,)                  mass [kg]
    V0: np.ndarray      # (n,)                  volume at rest [m^d]
    mu: np.ndarray      # (s, parameters)       what differs between runs
    x: np.ndarray       # (s, k + 1, n, d)      position [m]
    F: np.ndarray       # (s, k + 1, n, d, d)   deformation gradient
    v: np.ndarray       # (s, k + 1, n, d)      velocity [m/s]
    dt: float           #                       length of a step [s]

    def of(self, runs):
        """The snapshots of some runs."""
        return self._replace(mu=self.mu[runs], x=self.x[runs], F=self.F[runs], v=self.v[runs])

    def flat(self):
        """x (s (k + 1), n, d) and F (s (k + 1), n, d, d) of all runs and time levels."""
        return self.x.reshape(-1, *self.X.shape), self.F.reshape(-1, *self.F.shape[2:])


def units(snapshots):
    """`Units` of training snapshots (LDM-appB). A component that hardly varies is measured like the
    one that varies most, and keeps its metres where none does.
    """
    X, u = snapshots.X, snapshots.x - snapshots.X
    axes = tuple(range(u.ndim - 1))
    std = u.std(axis=axes)
    span = np.ptp(X, axis=0)
    varies = std > STILL * span
    like = std.max() if varies.any() else 1.0
    return Units(X.min(axis=0), span, u.mean(axis=axes), np.where(varies, std, like))


def position_error(x, reference, origin=0.0):
    """The papers' accumulated position error (LDM-err, NSF-eq11): || x - x' || / || x' - origin ||.

    It depends on the origin [m]; see `displacement_error` for one that does not.
    """
    return float(np.linalg.norm(x - reference) / np.linalg.norm(reference - origin))


def displacement_error(x, reference, X):
    """|| x - x' || / || x' - X ||: relative to how far points have moved."""
    return position_error(x, reference, X)
