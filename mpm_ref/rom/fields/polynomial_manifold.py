"""A curved manifold on POD modes: the first coordinates are free, the others polynomials of them.

    x = X + sum_k a_k U_k(X),    a = (xhat, C m(xhat)),    m all monomials of degree 2 .. p

C is the least-squares fit of the snapshots' further coordinates: no training but one linear solve,
fewer latent coordinates than modes, and the gradients of the modes. Quadratic ones are
those of J. Barnett and C. Farhat, "Quadratic approximation manifold for mitigating the Kolmogorov
barrier in nonlinear projection-based model order reduction", J. Comput. Phys. 464 (2022) 111348.
"""

from itertools import combinations_with_replacement
from math import comb
from typing import NamedTuple

import numpy as np

from .pod import PodModes

RIDGE = 1e-6        # of the fit, over the sum of squares of each monomial


class Curved(NamedTuple):
    """A map with r free coordinates over R modes."""

    modes: PodModes
    powers: np.ndarray      # (monomials, r) of xhat, integer
    C: np.ndarray           # (R - r, monomials)

    @property
    def dim(self):
        """Number of axes d."""
        return self.modes.dim

    @property
    def r(self):
        """Number of latent coordinates."""
        return self.powers.shape[1]

    def all(self, xhat):
        """Return the coordinates (R,) of all modes."""
        return np.concatenate([xhat, self.C @ monomials(xhat, self.powers)])

    def rates(self, xhat):
        """Return the derivatives (R, r) of the modes' coordinates by xhat."""
        return np.vstack([np.eye(self.r), self.C @ slopes(xhat, self.powers)])

    def place(self, X, xhat):
        """Return x of points X (n, d) [m]."""
        return self.modes.place(X, self.all(xhat))

    def derivatives(self, X, xhat):
        """Return x (n, d), F (n, d, d) and dg/dxhat (n, d, r) at points X (n, d)."""
        x, F, U = self.modes.derivatives(X, self.all(xhat))
        return x, F, U @ self.rates(xhat)

    def velocity(self, X, xhat, vhat):
        """Return dg/dxhat vhat of points X (n, d) [m/s]."""
        return self.modes.velocity(X, None, self.rates(xhat) @ vhat)


def curved(basis, r, degree, weights=1.0):
    """Return the `Curved` map of the r leading modes of a `pod.Basis`, fitted to its snapshots with
    these weights. Raises ValueError where no modes are left to follow, the degree is below 2, or
    there are more monomials than snapshots.
    """
    R, s = basis.modes.r, len(basis.xhat)
    if not 1 <= r < R:
        raise ValueError(f"r = {r} of {R} modes: expected 1 .. {R - 1}, so that others follow")
    if degree < 2:
        raise ValueError(f"degree = {degree}: expected at least 2; degree 1 is `modes`")
    count = comb(r + degree, degree) - r - 1
    if count > s:
        raise ValueError(f"degree = {degree}: {count} monomials of {r} coordinates, but {s} "
                         "snapshots to fit them to; take a smaller degree or r, or more snapshots")
    chosen = [np.bincount(c, minlength=r) for p in range(2, degree + 1)
              for c in combinations_with_replacement(range(r), p)]
    powers = np.array(chosen)
    w = np.broadcast_to(np.asarray(weights, dtype=float), s)[:, None]
    M = w * np.array([monomials(y, powers) for y in basis.xhat[:, :r]])
    normal = M.T @ M
    C = np.linalg.solve(normal + RIDGE * np.diag(np.diag(normal)), M.T @ (w * basis.xhat[:, r:]))
    return Curved(basis.modes, powers, C.T)


def monomials(xhat, powers):
    """Return the monomials (monomials,) at xhat (r,)."""
    return np.prod(xhat**powers, axis=1)


def slopes(xhat, powers):
    """Return the derivatives (monomials, r) of the monomials by xhat."""
    derivatives = np.empty(powers.shape)
    for j in range(powers.shape[1]):
        lower = powers.copy()
        lower[:, j] = np.maximum(lower[:, j] - 1, 0)
        derivatives[:, j] = powers[:, j] * monomials(xhat, lower)
    return derivatives
