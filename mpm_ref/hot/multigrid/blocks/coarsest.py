"""The twin of `krylov.pcg` in one kernel, for a coarsest level of few nodes."""

import numpy as np

from ....core.jit import kernel
from ....core.tensor import dot, lin, mat, mv, put_vec, vec
from .product import row_times


@kernel
def _precondition(D_inv, r, z, like):
    """z = D^+ r; returns r . z."""
    s = 0.0
    for i in range(len(r)):
        z_i = mv(mat(D_inv, i, like), vec(r, i, like))
        put_vec(z, i, z_i)
        s += dot(vec(r, i, like), z_i)
    return s


@kernel
def _product(A, p, q):
    """q = A p; returns p . q."""
    s = 0.0
    for i in range(len(p)):
        q_i = row_times(A, i, p)
        put_vec(q, i, q_i)
        s += dot(vec(p, i, A.like.shape), q_i)
    return s


@kernel
def _advance(u, alpha, p, like):
    for i in range(len(u)):
        put_vec(u, i, lin(1.0, vec(u, i, like), alpha, vec(p, i, like)))


@kernel
def _turn(p, beta, z, like):
    for i in range(len(p)):
        put_vec(p, i, lin(1.0, vec(z, i, like), beta, vec(p, i, like)))


@kernel
def _solve(A, D_inv, vectors, stop, cap):
    u, r, z, p, q = vectors
    rz = _precondition(D_inv, r, z, A.like.shape)
    _turn(p, 0.0, z, A.like.shape)
    for k in range(cap):
        if not rz > stop:
            return k
        curvature = _product(A, p, q)
        if not curvature > 0.0:
            return k
        alpha = rz / curvature
        _advance(u, alpha, p, A.like.shape)
        _advance(r, -alpha, q, A.like.shape)
        rz, old = _precondition(D_inv, r, z, A.like.shape), rz
        _turn(p, rz / old, z, A.like.shape)
    return cap


def conjugate_gradients(A, D_inv, b, enough, cap):
    """(u, iterations) of A u = b from u = 0 until sqrt(r^T D^+ r) <= enough (HOT-sec5.3-coarse), as
    `coarsest.by_pcg`; A Planes, D_inv (n, d, d), b (n, d).
    """
    u, p = np.zeros_like(b), np.zeros_like(b)
    vectors = u, b.copy(), np.empty_like(b), p, np.empty_like(b)
    return u, _solve(A, D_inv, vectors, enough**2, cap)
