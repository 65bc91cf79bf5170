"""L-BFGS from a given first inverse, by dense updates in place of two loops (HOT-alg3).

The inverse of the i-th iterate starts from H_0, a matrix (n, n) of unknowns u (n,), and takes the
last w pairs, oldest first:

    H <- (I - rho s y^T) H (I - rho y s^T) + rho s s^T,    rho = 1/(y.s)
    s^a = u^(a+1) - u^a,    y^a = g^(a+1) - g^a,    a = i - w, .., i - 1
"""

import numpy as np


def updated(H, s, y):
    """Return the inverse H (n, n) with one pair s, y (n,); H itself unless y . s > 0."""
    curvature = y @ s
    if curvature <= 0.0:
        return H
    T = np.eye(len(s)) - np.outer(s, y) / curvature
    return T @ H @ T.T + np.outer(s, s) / curvature


def direction(H, pairs, g, window):
    """Return -H_i g (n,), from the first inverse H and all pairs (s, y), oldest first."""
    for s, y in pairs[max(len(pairs) - window, 0):]:
        H = updated(H, s, y)
    return -H @ g


def step_length(energy, u, p):
    """Return the first of 1, 1/2, 1/4, .. for which the energy does not grow along p."""
    alpha, E = 1.0, energy(u)
    while energy(u + alpha * p) > E:
        alpha /= 2.0
    return alpha


def iterates(energy, gradient, H, u, window, count):
    """Return u (count + 1, n) and its next iterates, for energy(u) and gradient(u) (n,)."""
    path, pairs, g = [u], [], gradient(u)
    for _ in range(count):
        p = direction(H, pairs, g, window)
        u = u + step_length(energy, u, p) * p
        g_new = gradient(u)
        pairs.append((u - path[-1], g_new - g))
        path.append(u)
        g = g_new
    return np.array(path)
