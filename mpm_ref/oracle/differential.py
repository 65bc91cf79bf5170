"""The projected differential of the stress in any floating type, computed unlike in the kernels.

    A_kl = dP_k/ds_l                    by complex steps
    a_kl = (P_k - P_l)/(s_k - s_l)      if s_k and s_l are close: a mean of A_kk - A_kl
    b_kl = (P_k + P_l)/(s_k + s_l)

in principal space [Teran2005], with negative eigenvalues set to zero (HOT-alg1). The laws in
`materials` give the quotients in closed form (`materials.principal`).
"""

from functools import partial
from typing import NamedTuple

import numpy as np

from ..plain.laws import energy_and_stress
from ..plain.tensors import compose, svd

NEAR = 1e-2         # stretches closer than this: the quotient would lose digits
POINTS = 8          # quadrature points of the mean: exact to round-off over NEAR
TINY = 1e-25        # complex step; nothing is subtracted, so it may be arbitrarily small
COMPLEX = {np.dtype(np.float32): np.complex64, np.dtype(np.float64): np.complex128,
           np.dtype(np.longdouble): np.clongdouble}


class StressDifferential(NamedTuple):
    """The differential dP/dF of N particles, in principal space [Pa]."""

    U: np.ndarray       # (N, d, d)
    V: np.ndarray       # (N, d, d)
    A: np.ndarray       # (N, d, d)
    a: np.ndarray       # (N, d, d)  symmetric, diagonal unused
    b: np.ndarray       # (N, d, d)


def piola(s, law):
    """Return the principal first Piola-Kirchhoff stresses P_k = tau_k / s_k (N, d) [Pa]."""
    return energy_and_stress(s, law)[1] / s


def slopes(s, law):
    """A_kl = dP_k/ds_l (N, d, d) [Pa]."""
    return jacobian(partial(piola, law=law), s)


def jacobian(f, s):
    """df_k/ds_l (N, d, d) of a function f of principal stretches s (N, d), by complex steps."""
    out = np.empty((*s.shape, s.shape[1]), s.dtype)
    for l in range(s.shape[1]):
        shifted = s.astype(COMPLEX[s.dtype])
        shifted[:, l] += s.dtype.type(TINY) * 1j
        out[:, :, l] = f(shifted).imag / s.dtype.type(TINY)
    return out


def mean_slope(f, s, k, l):
    """(f_k - f_l)/(s_k - s_l) of an isotropic f as the mean of A_kk - A_kl, A = df/ds.

    The mean is along the line on which s_k and s_l exchange their values.
    """
    total = np.zeros(len(s), s.dtype)
    points, weights = (a.astype(s.dtype) for a in np.polynomial.legendre.leggauss(POINTS))
    for t, weight in zip(points, weights / weights.sum()):
        point, shift = s.copy(), (1 + t) / 2 * (s[:, l] - s[:, k])
        point[:, k] += shift
        point[:, l] -= shift
        A = jacobian(f, point)
        total += weight * (A[:, k, k] - A[:, k, l])
    return total


def difference_quotients(s, law):
    """Return a_kl and b_kl (N, d, d) [Pa] of all pairs of axes; the diagonals are 0."""
    f = partial(piola, law=law)
    P, d = f(s), s.shape[1]
    a, b = np.zeros((2, *s.shape, d), s.dtype)
    for k, l in zip(*np.tril_indices(d, -1)):
        gap = s[:, k] - s[:, l]
        near = abs(gap) < NEAR
        far = (P[:, k] - P[:, l]) / np.where(near, 1, gap)
        a[:, k, l] = a[:, l, k] = np.where(near, mean_slope(f, s, k, l), far)
        b[:, k, l] = b[:, l, k] = (P[:, k] + P[:, l]) / (s[:, k] + s[:, l])
    return a, b


def semidefinite(A):
    """Return symmetric A (N, d, d) with its negative eigenvalues set to zero.

    By the singular values of A + c I, which is positive definite.
    """
    c = 2 * np.sqrt((A * A).sum(axis=(1, 2)))[:, None]
    eye = np.eye(A.shape[1], dtype=A.dtype)
    _, s, V = svd(A + np.where(c > 0, c, 1)[:, :, None] * eye)
    w = s - np.where(c > 0, c, 1)
    return np.where((w.min(axis=1) < 0)[:, None, None], compose(V, np.maximum(w, 0), V), A)


def stress_differential(F, law):
    """Return the `StressDifferential` at F (N, d, d), projected to be positive semidefinite."""
    U, s, V = svd(F)
    a, b = difference_quotients(s, law)
    A = semidefinite(slopes(s, law))
    return StressDifferential(U, V, A, np.maximum(a, 0), np.maximum(b, 0))


def apply_differential(m, dF):
    """dP = dP/dF : dF (N, d, d) [Pa] of the `StressDifferential` m and dF (N, d, d)."""
    X = np.einsum("pba,pbc,pcd->pad", m.U, dF, m.V)
    X_T = np.swapaxes(X, 1, 2)
    Y = m.a * (X + X_T) / 2 + m.b * (X - X_T) / 2
    axis = np.arange(dF.shape[1])
    Y[:, axis, axis] = np.einsum("pab,pb->pa", m.A, X[:, axis, axis])
    return np.einsum("pab,pbc,pdc->pad", m.U, Y, m.V)
