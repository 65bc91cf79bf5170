"""Determinant and singular value decomposition of N small matrices (N, d, d), in any floating type.

NumPy's own functions serve single and double precision only.
"""

import numpy as np

SWEEPS = 12     # of Jacobi rotations; they converge quadratically, 6 suffice for longdouble


def det(A):
    """Return the determinants (N,) of A (N, d, d)."""
    if A.shape[1] == 2:
        return A[:, 0, 0] * A[:, 1, 1] - A[:, 0, 1] * A[:, 1, 0]
    return np.einsum("pa,pa->p", A[:, 0], np.cross(A[:, 1], A[:, 2]))


def svd(F):
    """F = U diag(s) V^T with rotations U, V (N, d, d) and s (N, d), for invertible F.

    One-sided Jacobi: rotations of two columns at a time, whose product is V, make the columns of
    F V orthogonal; their lengths are the singular values s, in no particular order. If det F < 0
    the least s is negative, so that U and V are rotations.
    """
    d = F.shape[1]
    A, V = F.copy(), np.tile(np.eye(d, dtype=F.dtype), (len(F), 1, 1))
    for _ in range(SWEEPS):
        for i in range(d):
            for j in range(i + 1, d):
                rotate(A, V, i, j)
    s = np.sqrt(np.einsum("pab,pab->pb", A, A))
    is_least = np.arange(d) == np.argmin(s, axis=1)[:, None]
    s = np.where(is_least & (det(F) < 0)[:, None], -s, s)
    return A / s[:, None], s, V


def rotate(A, V, i, j):
    """Turn columns i and j of A, and of V, by the angle that makes those of A orthogonal; in place.

    With a, b the columns of A the angle is given by tan(2 angle) = 2 a.b / (b.b - a.a).
    """
    a, b = A[:, :, i], A[:, :, j]
    off = 2 * np.einsum("pa,pa->p", a, b)
    gap = np.einsum("pa,pa->p", b, b) - np.einsum("pa,pa->p", a, a)
    length = np.hypot(gap, off)
    # t = tan(angle), |angle| <= pi/4
    t = off / np.where(off == 0, 1, np.abs(gap) + length) * np.where(gap < 0, -1, 1)
    c = 1 / np.sqrt(1 + t * t)
    for M in (A, V):
        m, n = M[:, :, i].copy(), M[:, :, j].copy()
        M[:, :, i] = c[:, None] * (m - t[:, None] * n)
        M[:, :, j] = c[:, None] * (n + t[:, None] * m)


def compose(U, s, V):
    """Return U diag(s) V^T (N, d, d)."""
    return np.einsum("pab,pb,pcb->pac", U, s, V)
