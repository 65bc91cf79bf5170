"""What a reduced model learns from: full-order runs of one body, all points at all steps."""

from typing import NamedTuple

import numpy as np

from .decoder import Units

STILL = 1e-12       # standard deviation of a component that does not vary, over its size


class Snapshots(NamedTuple):
    """s runs of n points over k steps; time levels 0 .. k, points in the body's own order."""

    X: np.ndarray       # (n, d)                at rest [m]
    m: np.ndarray       # (n,)                  mass [kg]
    V0: np.ndarray      # (n,)                  volume at rest [m^d]
    mu: np.ndarray      # (s, parameters)       what differs between runs
    x: np.ndarray       # (s, k + 1, n, d)      position [m]
    F: np.ndarray       # (s, k + 1, n, d, d)   deformation gradient; None: unknown
    v: np.ndarray       # (s, k + 1, n, d)      velocity [m/s]; None: unknown
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
    span = np.ptp(X, axis=0)
    return Units(X.min(axis=0), span, u.mean(axis=axes), measures(u.std(axis=axes), span))


def measures(std, size):
    """What components of standard deviations std (k,) are measured in; one that hardly varies,
    against a size (k,) or one for all, like the one that varies most, or in 1 where none does.
    """
    varies = std > STILL * size
    return np.where(varies, std, std.max() if varies.any() else 1.0)


def position_error(x, reference, origin=0.0):
    """The papers' accumulated position error (LDM-err, NSF-eq11): || x - x' || / || x' - origin ||.

    It depends on the origin [m]; see `displacement_error` for one that does not.
    """
    return float(np.linalg.norm(x - reference) / np.linalg.norm(reference - origin))


def displacement_error(x, reference, X):
    """|| x - x' || / || x' - X ||: relative to how far points have moved."""
    return position_error(x, reference, X)
