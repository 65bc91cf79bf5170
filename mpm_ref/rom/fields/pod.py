"""Proper orthogonal decomposition as a linear manifold: x = X + sum_k xhat_k U_k(X).

The r modes that leave the least square error of a set of displacements are its leading singular
vectors. Each is a sum of snapshots, so that its gradient is the same sum of their F - I, without
any differentiation; and the body at rest is xhat = 0. Between the points of the data, value and
gradient of the modes are those of a linear fit to the nearest ones.
"""

from typing import NamedTuple

import numpy as np
from scipy.sparse.linalg import svds
from scipy.spatial import KDTree

from ...core.blas import one_thread

NEAREST = 16        # points of a linear fit between the data
SMALL = 500         # rows or columns up to which all singular values are computed
SAME = 1e-9         # distance below which a point is one of the data, over the body's extent
LEAST = 1e-10       # singular value over the largest one: modes below are round-off


class PodModes(NamedTuple):
    """A linear map by POD modes on the points of its data."""

    X: np.ndarray       # (n, d)        points [m]
    U: np.ndarray       # (n, d, r)     modes [m]
    slope: np.ndarray      # (n, d, d, r)  their gradients d U_a / d X_b
    tree: KDTree        # of X

    @property
    def dim(self):
        """Number of axes d."""
        return self.X.shape[1]

    @property
    def r(self):
        """Number of latent coordinates."""
        return self.U.shape[2]

    def place(self, X, xhat):
        """Return x of points X (n, d) [m]."""
        return X + self._at(X)[0] @ xhat

    def derivatives(self, X, xhat):
        """Return x (n, d), F (n, d, d) and the modes at points X (n, d)."""
        U, slope = self._at(X)
        return X + U @ xhat, np.eye(self.dim) + slope @ xhat, U

    def velocity(self, X, xhat, vhat):
        """Return the velocities (n, d) [m/s] of points X (n, d)."""
        return self._at(X)[0] @ vhat

    def _at(self, X):
        """Return U and slope at points: of the data, or fitted between them."""
        far, i = self.tree.query(X)
        U, slope = self.U[i], self.slope[i]
        off = far > SAME * np.ptp(self.X, axis=0).max()
        if off.any():
            U[off], slope[off] = self._fit(X[off])
        return U, slope

    def _fit(self, X):
        """Return U and slope by moving least squares of first order."""
        _, near = self.tree.query(X, range(1, min(NEAREST, len(self.X)) + 1))
        arms = self.X[near] - X[:, None]
        basis = np.concatenate([np.ones((*arms.shape[:2], 1)), arms], axis=2)
        fit = np.einsum("ncm,nmar->ncar", np.linalg.pinv(basis), self.U[near])
        return fit[:, 0], np.moveaxis(fit[:, 1:], 1, 2)


class Basis(NamedTuple):
    """`PodModes`, and the coordinates of the snapshots that they were made of."""

    modes: PodModes
    xhat: np.ndarray        # (s, r)


def modes(X, x, F, r):
    """Return the best `PodModes` with r coordinates for snapshots x (s, n, d) [m], F (s, n, d, d)
    of points X (n, d); coordinates are scaled to a root mean square of 1 over the snapshots. Raises
    ValueError for more modes than the snapshots hold.
    """
    return basis(X, x, F, r).modes


def basis(X, x, F, r, lam_F=0.0, weights=1.0):
    """Return the `Basis` of r modes that leaves the least sum over snapshots s of
    weights_s^2 (|| x_s ||^2 + lam_F || F_s ||^2) [m^2]. Raises ValueError for more modes than the
    snapshots hold.
    """
    w, left = decomposed(X, x, F, r, lam_F, weights)
    with one_thread():
        shares = w[:, None] * left / np.sqrt(len(x))    # of the snapshots in a scaled mode
        U = np.tensordot(x - X, shares, axes=(0, 0))
        slope = np.tensordot(F - np.eye(X.shape[1]), shares, axes=(0, 0))
    return Basis(PodModes(X, U, slope, KDTree(X)), scaled(w, left))


def directions(X, x, r):
    """Return the r leading modes U (n, d, r) [m] of snapshots x (s, n, d) [m], without gradients,
    and the snapshots' coordinates (s, r).

    All coordinates have one unit, in which the first has a root mean square of 1, and all modes
    the same norm. Raises ValueError for more modes than the snapshots hold.
    """
    _, left = decomposed(X, x, None, r, 0.0, 1.0)
    with one_thread():
        U = np.tensordot(x - X, left, axes=(0, 0))      # as long as singular values
        sigma = np.sqrt(np.sum(U**2, axis=(0, 1)))
        unit = sigma[0] / np.sqrt(len(x))
    return U / sigma * unit, left * sigma / unit


def scaled(w, left):
    """Return the coordinates (s, r) of snapshots with weights w (s,) from their left singular
    vectors.
    """
    return left * np.sqrt(len(left)) / w[:, None]


def decomposed(X, x, F, r, lam_F, weights):
    """Return the weights (s,) and the r leading left singular vectors (s, r) of weighted snapshots.
    Raises ValueError for more than they hold.
    """
    s, n, d = x.shape
    if not 1 <= r <= min(s, n * d):
        raise ValueError(f"r = {r}: expected 1 .. {min(s, n * d)} modes of {s} snapshots")
    w = np.broadcast_to(np.asarray(weights, dtype=float), s)
    with one_thread():
        left, sigma = leading(w[:, None] * measured(X, x, F, lam_F), r)
    rank = numerical_rank(sigma)
    if rank < r:
        raise ValueError(f"r = {r}: the snapshots hold only {rank} modes, more would be round-off; "
                         "take fewer, or snapshots that differ more")
    return w, left


def numerical_rank(sigma):
    """Return the number of descending singular values that are more than round-off."""
    return int(np.sum(sigma > LEAST * sigma[0]))


def measured(X, x, F, lam_F):
    """Return rows (s, ..) whose length is the norm of displacements [m], with F or without."""
    u = (x - X).reshape(len(x), -1)
    if not lam_F:
        return u
    return np.hstack([u, np.sqrt(lam_F) * (F - np.eye(X.shape[1])).reshape(len(x), -1)])


def leading(A, r):
    """Return the r leading left singular vectors (m, r) and values (r,) of a matrix, largest first;
    of a large one by Lanczos' method, always from the same start.
    """
    if min(A.shape) <= SMALL:
        U, s, _ = np.linalg.svd(A, full_matrices=False)
        return U[:, :r], s[:r]
    U, s, _ = svds(A, r, v0=np.ones(min(A.shape)))
    order = np.argsort(-s)
    return U[:, order], s[order]
