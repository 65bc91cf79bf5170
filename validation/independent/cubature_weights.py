"""Weights of samples by non-negative least squares, for NSF's inversion.

    min_{w >= 0} | A w - b |,    A_(kl)p = U_kp . U_lp,    b_(kl) = delta_kl,    k <= r,  l <= R

so that modes U, orthonormal over all points, stay so over weighted samples [AnKimJames2008]. The
relative residual |A w - b| / |b| measures the samples.
"""

import numpy as np
from scipy.optimize import nnls


def equations(U, r):
    """Return A (r R, n) and b (r R,) of modes U (n, d, R), of which the first r are latent."""
    n, _, R = U.shape
    return np.einsum("pdk,pdl->klp", U[:, :, :r], U).reshape(-1, n), np.eye(r, R).ravel()


def weights(U, r, points):
    """Return the weights (m,) of points, and their relative residual."""
    A, b = equations(U, r)
    w, residual = nnls(A[:, points], b)
    return w, residual / np.linalg.norm(b)


def equal_weights(U, r, points):
    """Return the relative residual of points that all have the best common weight."""
    A, b = equations(U, r)
    return nnls(A[:, points].sum(axis=1, keepdims=True), b)[1] / np.linalg.norm(b)


def greedy(U, r, count):
    """Return the sorted points with a weight after a search that adds the point of the largest
    component along the residual, `count` times.
    """
    A, b = equations(U, r)
    unit = A / np.linalg.norm(A, axis=0)
    chosen, w = [], np.zeros(0)
    for _ in range(count):
        gains = (b - A[:, chosen] @ w) @ unit
        gains[chosen] = -np.inf
        chosen.append(int(np.argmax(gains)))
        w = nnls(A[:, chosen], b)[0]
    return np.sort(np.array(chosen)[w > 0.0])
