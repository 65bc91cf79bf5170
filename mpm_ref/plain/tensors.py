"""Determinants and singular values of arrays of small matrices (N, d, d), in any floating type.

NumPy's own are for double precision only.
"""

import numpy as np

SWEEPS = 12     # of rotations; they converge quadratically, about 6 suffice for longdouble


def det(A):
    """Determinants (N,)."""
    if A.shape[1] == 2:
        return A[:, 0, 0] * A[:, 1, 1] - A[:, 0, 1] * A[:, 1, 0]
    return np.einsum("pa,pa->p", A[:, 0], np.cross(A[:, 1], A[:, 2]))


def svd(F):
    """F = U diag(s) V^T, rotations U and V, of invertible F; det F < 0 makes the least s negative.

    One-sided Jacobi: rotations of column pairs, gathered in V, make the columns of F V orthogonal;
    their lengths are the singular values, here in no particular order.
    """
    d = F.shape[1]
    A, V = F.copy(), np.tile(np.eye(d, dtype=F.dtype), (len(F), 1, 1))
    for _ in range(SWEEPS):
        for i in range(d):
            for j in range(i + 1, d):
                rotate(A, V, i, j)
    s = np.sqrt(np.einsum("pab,pab->pb", A, A))
    mirrored = np.arange(d) == np.argmin(s, axis=1)[:, None]
    s = np.where(mirrored & (det(F) < 0)[:, None], -s, s)
    return A / s[:, None], s, V


def rotate(A, V, i, j):
    """Turn columns i and j of A, and of V, in place, such that those of A become orthogonal."""
    a, b = A[:, :, i], A[:, :, j]
    off = 2 * np.einsum("pa,pa->p", a, b)
    gap = np.einsum("pa,pa->p", b, b) - np.einsum("pa,pa->p", a, a)
    length = np.hypot(gap, off)
    # tan(2 angle) = off / gap, |angle| <= pi/4
    t = off / np.where(off == 0, 1, np.abs(gap) + length) * np.where(gap < 0, -1, 1)
    c = 1 / np.sqrt(1 + t * t)
    for M in (A, V):
        m, n = M[:, :, i].copy(), M[:, :, j].copy()
        M[:, :, i] = c[:, None] * (m - t[:, None] * n)
        M[:, :, j] = c[:, None] * (n + t[:, None] * m)


def compose(U, s, V):
    """U diag(s) V^T."""
    return np.einsum("pab,pb,pcb->pac", U, s, V)
