"""Smooth functions of latent coordinates through given values: cubic radial functions.

    f(y) = sum_j w_j |y - y_j|^3 + b + A y,    sum_j w_j = 0,    sum_j w_j y_j^T = 0

Of all functions through the values it is the one of least bending; no centre or width is to be
chosen, and its derivative is as cheap as its value. (H. Wendland, Scattered Data Approximation,
2004, chapter 8.) Where centres coincide, as runs of different parameters do at rest, values may
contradict each other; a smoothing lets the function miss them.
"""

from contextlib import suppress
from typing import NamedTuple

import numpy as np

from ...core.blas import one_thread

SMOOTHING = 1e-8        # on the diagonal, coordinates measured so that their spread is about 1


class Radial(NamedTuple):
    """A function of q coordinates with k values, through s centres."""

    centers: np.ndarray     # (s, q) over `unit`
    unit: np.ndarray        # (q,) units of the coordinates
    w: np.ndarray           # (s, k)
    tail: np.ndarray        # (1 + q, k) b, then A

    def value(self, y):
        """Return f (k,) at coordinates y (q,)."""
        y = y / self.unit
        away = np.sqrt(np.sum((y - self.centers) ** 2, axis=1))
        return away**3 @ self.w + self.tail[0] + y @ self.tail[1:]

    def slope(self, y):
        """Return df/dy (k, q) at coordinates y (q,)."""
        y = y / self.unit
        arms = y - self.centers
        away = np.sqrt(np.sum(arms**2, axis=1))
        inner = (3.0 * away[:, None] * arms).T @ self.w + self.tail[1:]
        return (inner / self.unit[:, None]).T


def through(y, values, unit, smoothing=SMOOTHING):
    """Return the `Radial` through values (s, k) at coordinates y (s, q) with units (q,). A
    coordinate that does not vary has no influence: its unit becomes infinite.

    Raises ValueError for fewer centres than the linear part has unknowns, and where they are not
    finite.
    """
    s, q = y.shape
    if s < q + 1:
        raise ValueError(f"{s} snapshots for functions of {q} coordinates: expected at least "
                         f"{q + 1}")
    if not (np.isfinite(y).all() and np.isfinite(values).all()):
        raise ValueError("a snapshot's coordinates or values are not finite; generate it again")
    unit = np.where(np.ptp(y, axis=0) > 0.0, unit, np.inf)
    centers = y / unit
    away = np.linalg.norm(centers[:, None] - centers, axis=2)
    P = np.hstack([np.ones((s, 1)), centers])
    A = np.block([[away**3 + smoothing * np.eye(s), P], [P.T, np.zeros((q + 1, q + 1))]])
    b = np.vstack([values, np.zeros((q + 1, values.shape[1]))])
    with one_thread():
        w = solve(A, b, np.linalg.matrix_rank(P) < q + 1)
    return Radial(centers, unit, w[:s], w[s:])


def solve(A, b, dependent):
    """Return the solution of A w = b; that of least length where coordinates depend on each other,
    and where centres coincide without smoothing.
    """
    if not dependent:
        with suppress(np.linalg.LinAlgError):
            return np.linalg.solve(A, b)
    return np.linalg.lstsq(A, b, rcond=None)[0]
