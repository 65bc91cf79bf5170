"""Smooth functions of latent coordinates through given values: cubic radial functions.

    f(y) = sum_j w_j |y - y_j|^3 + b + A y,    sum_j w_j = 0,    sum_j w_j y_j^T = 0

Of all functions through the values it is the one of least bending; no centre or width is to be
chosen, and its derivative is as cheap as its value. (H. Wendland, Scattered Data Approximation,
2004, chapter 8.) Where centres meet, as runs of different parameters do at rest, values may
contradict each other: they are met up to a smoothing.
"""

from contextlib import suppress
from typing import NamedTuple

import numpy as np

from ...core.blas import one_thread

SMOOTHING = 1e-8        # on the diagonal, coordinates measured so that their spread is about 1


class Radial(NamedTuple):
    """A function of q coordinates with k values, through s centres."""

    centers: np.ndarray     # (s, q) over `unit`
    unit: np.ndarray        # (q,) what coordinates are measured in
    w: np.ndarray           # (s, k)
    tail: np.ndarray        # (1 + q, k) b, then A

    def value(self, y):
        """f (k,) at coordinates y (q,)."""
        y = y / self.unit
        away = np.sqrt(np.sum((y - self.centers) ** 2, axis=1))
        return away**3 @ self.w + self.tail[0] + y @ self.tail[1:]

    def slope(self, y):
        """df/dy (k, q)."""
        y = y / self.unit
        arms = y - self.centers
        away = np.sqrt(np.sum(arms**2, axis=1))
        inner = (3.0 * away[:, None] * arms).T @ self.w + self.tail[1:]
        return (inner / self.unit[:, None]).T


def through(y, values, unit, smoothing=SMOOTHING):
    """`Radial` through values (s, k) at coordinates y (s, q), measured in unit (q,). A coordinate
    that does not vary says nothing, then and later: it is measured in an infinite unit.

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
        found = solved(A, b, np.linalg.matrix_rank(P) < q + 1)
    return Radial(centers, unit, found[:s], found[s:])


def solved(A, b, dependent):
    """The solution of A w = b; of least length where coordinates depend on each other, and where
    centres meet without smoothing.
    """
    if not dependent:
        with suppress(np.linalg.LinAlgError):
            return np.linalg.solve(A, b)
    return np.linalg.lstsq(A, b, rcond=None)[0]
