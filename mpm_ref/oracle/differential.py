"""The projected differential of the stress in any floating type, by another way than the kernels'.

    A_kl = dP_k/ds_l                                by complex steps
    a_kl = (P_k - P_l)/(s_k - s_l)                  of near stretches: a mean of A_kk - A_kl
    b_kl = (P_k + P_l)/(s_k + s_l)

in principal space [Teran2005], with negative eigenvalues set to zero (HOT-alg1): see
`materials.principal`, where laws give the quotients in closed form.
"""

from functools import partial
from typing import NamedTuple

import numpy as np

from ..plain.laws import energy_and_stress
from ..plain.tensors import compose, svd

NEAR = 1e-2         # stretches nearer than this: the quotient would lose digits
POINTS = 8          # of the mean: exact to round-off over NEAR
TINY = 1e-25        # complex step: nothing is subtracted, so it may be as small as one likes
COMPLEX = {np.dtype(np.float32): np.complex64, np.dtype(np.float64): np.complex128,
           np.dtype(np.longdouble): np.clongdouble}


class Modes(NamedTuple):
    """Differentials of N particles, in principal space [Pa]."""

    U: np.ndarray       # (N, d, d)
    V: np.ndarray       # (N, d, d)
    A: np.ndarray       # (N, d, d)
    a: np.ndarray       # (N, d, d)  symmetric, diagonal unused
    b: np.ndarray       # (N, d, d)


def stresses(s, law):
    """Principal first Piola-Kirchhoff stresses (N, d)."""
    return energy_and_stress(s, law)[1] / s


def slopes(s, law):
    """A (N, d, d): dP_k/ds_l."""
    return derivatives(partial(stresses, law=law), s)


def derivatives(f, s):
    """df_k/ds_l (N, d, d) of a function f of principal stretches s (N, d)."""
    out = np.empty((*s.shape, s.shape[1]), s.dtype)
    for l in range(s.shape[1]):
        moved = s.astype(COMPLEX[s.dtype])
        moved[:, l] += s.dtype.type(TINY) * 1j
        out[:, :, l] = f(moved).imag / s.dtype.type(TINY)
    return out


def mean_slope(f, s, k, l):
    """Mean of A_kk - A_kl, A the `derivatives` of an isotropic f, on the way that exchanges s_k and
    s_l: it is (f_k - f_l)/(s_k - s_l).
    """
    total = np.zeros(len(s), s.dtype)
    points, weights = (a.astype(s.dtype) for a in np.polynomial.legendre.leggauss(POINTS))
    for t, weight in zip(points, weights / weights.sum()):
        at, way = s.copy(), (1 + t) / 2 * (s[:, l] - s[:, k])
        at[:, k] += way
        at[:, l] -= way
        A = derivatives(f, at)
        total += weight * (A[:, k, k] - A[:, k, l])
    return total


def quotients(s, law):
    """a, b (N, d, d) of all pairs."""
    f = partial(stresses, law=law)
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
    """Symmetric A (N, d, d) without negative eigenvalues: by the singular values of A + c I."""
    c = 2 * np.sqrt((A * A).sum(axis=(1, 2)))[:, None]
    eye = np.eye(A.shape[1], dtype=A.dtype)
    _, s, V = svd(A + np.where(c > 0, c, 1)[:, :, None] * eye)
    w = s - np.where(c > 0, c, 1)
    return np.where((w.min(axis=1) < 0)[:, None, None], compose(V, np.maximum(w, 0), V), A)


def modes(F, law):
    """`Modes` at F (N, d, d), projected."""
    U, s, V = svd(F)
    a, b = quotients(s, law)
    return Modes(U, V, semidefinite(slopes(s, law)), np.maximum(a, 0), np.maximum(b, 0))


def applied(m, dF):
    """dP (N, d, d) [Pa] of dF."""
    X = np.einsum("pba,pbc,pcd->pad", m.U, dF, m.V)
    X_T = np.swapaxes(X, 1, 2)
    Y = m.a * (X + X_T) / 2 + m.b * (X - X_T) / 2
    axis = np.arange(dF.shape[1])
    Y[:, axis, axis] = np.einsum("pab,pb->pa", m.A, X[:, axis, axis])
    return np.einsum("pab,pbc,pdc->pad", m.U, Y, m.V)


def stiffness(m):
    """A bound (N,) on the eigenvalues of the differential [Pa]."""
    A = np.sqrt((m.A * m.A).sum(axis=(1, 2)))
    return np.maximum(A, np.maximum(m.a, m.b).max(axis=(1, 2)))


def components(m):
    """The differential as (N, d^2, d^2): column k is dP of the unit dF with entry k."""
    d = m.U.shape[1]
    units = np.eye(d * d, dtype=m.U.dtype).reshape(d * d, 1, d, d)
    columns = [applied(m, np.broadcast_to(e, m.U.shape)) for e in units]
    return np.stack([c.reshape(-1, d * d) for c in columns], axis=2)
