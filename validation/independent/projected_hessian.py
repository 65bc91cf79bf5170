"""The Hessian of fixed corotated elasticity, and its positive part (HOT-alg1, NCLAW-eq12).

    psi(F) = mu |F - R|^2 + lam/2 (J - 1)^2 = mu (|F|^2 - 2 tr S + d) + lam/2 (J - 1)^2

with F = R S, det R = 1 and J = det F. Neither singular values nor quotients of them are used.

tr S = max_R R : F is the largest eigenvalue kappa of a symmetric matrix K that is linear in F: of
forms in unit quaternions in 3D, in those about the third axis in 2D. Its derivatives are those of a
simple eigenvalue, whatever the sign of det F; they grow without bound where it becomes double:

    d(tr S) = q.dK q,      d2(tr S) = 2 sum_k (q.dK q_k)^2 / (kappa - kappa_k)

J is linear in every row of F: its derivatives are determinants with rows replaced by unit vectors.
"""

from itertools import product

import numpy as np


def rotation(q):
    """Return |q|^2 times the rotation (3, 3) of a quaternion q (4,), its real part first."""
    w, u = q[0], q[1:]
    return (w * w - u @ u) * np.eye(3) + 2.0 * np.outer(u, u) + 2.0 * w * np.cross(u, np.eye(3)).T


def rotation_forms(d):
    """Return the forms (d, d, k, k) with R(q)_ab = q . forms_ab q, by polarisation."""
    basis = np.eye(4) if d == 3 else np.eye(4)[[0, 3]]
    return 0.25 * np.array([[rotation(p + q) - rotation(p - q) for q in basis]
                            for p in basis]).transpose(2, 3, 0, 1)[:d, :d]


def stretch_sum(F):
    """Return tr S, its gradient (d, d), which is R, and its Hessian (d d, d d), of F (d, d)."""
    forms = rotation_forms(len(F))
    kappa, Q = np.linalg.eigh(np.einsum("abij,ab->ij", forms, F))
    dK = np.einsum("abij,i,jk->abk", forms, Q[:, -1], Q)
    slopes = dK[..., :-1].reshape(F.size, -1)
    return kappa[-1], dK[..., -1], 2.0 * slopes / (kappa[-1] - kappa[:-1]) @ slopes.T


def replaced_det(F, *units):
    """Return det F (d, d) with row a replaced by the b-th unit vector, for pairs (a, b)."""
    G = F.copy()
    for a, b in units:
        G[a] = np.eye(len(F))[b]
    return np.linalg.det(G)


def volume_ratio(F):
    """Return J, its gradient (d, d) and its Hessian (d d, d d) of F (d, d)."""
    entries = list(product(range(len(F)), repeat=2))
    gradient = np.array([replaced_det(F, one) for one in entries])
    hessian = np.array([[replaced_det(F, one, two) if one[0] != two[0] else 0.0
                         for two in entries] for one in entries])
    return np.linalg.det(F), gradient.reshape(F.shape), hessian


def pk1(F, mu, lam):
    """Return P (d, d) [Pa] at F (d, d), for moduli mu and lam [Pa]."""
    _, R, _ = stretch_sum(F)
    J, dJ, _ = volume_ratio(F)
    return 2.0 * mu * (F - R) + lam * (J - 1.0) * dJ


def hessian(F, mu, lam):
    """Return d2psi/dF2 (d d, d d) [Pa] at F (d, d), for moduli mu and lam [Pa]."""
    J, dJ, d2J = volume_ratio(F)
    volume = np.outer(dJ, dJ) + (J - 1.0) * d2J
    return 2.0 * mu * (np.eye(F.size) - stretch_sum(F)[2]) + lam * volume


def positive_part(H):
    """Return a symmetric matrix with its negative eigenvalues set to zero (HOT-alg1)."""
    values, vectors = np.linalg.eigh(H)
    return (vectors * np.maximum(values, 0.0)) @ vectors.T


def assembled(m, y, A):
    """Return M + sum_p y_ip A_p y_jp (n d, n d) [kg], the Hessian of HOT-eq1.

    m (n,) are masses of nodes [kg], y (N, n, d) is (F_p^n)^T dw_ip [1/m], and A (N, d d, d d) is
    dt^2 V0_p d2psi/dF2 [kg m^2].
    """
    N, n, d = y.shape
    B = np.einsum("ac,pib->pabic", np.eye(d), y).reshape(N, d * d, n * d)
    return np.diag(np.repeat(m, d)) + np.tensordot(B, A @ B, axes=([0, 1], [0, 1]))
