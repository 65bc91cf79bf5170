"""B-splines by their recursion, and the nodes around a particle."""

from typing import NamedTuple

import numpy as np


def bspline(u, degree):
    """N(u) of the uniform B-spline with knots 0 .. degree + 1, by the recursion of Cox and de Boor.

    N_0(u) = 1 for 0 <= u < 1, else 0
    N_k(u) = (u N_{k-1}(u) + (k + 1 - u) N_{k-1}(u - 1)) / k
    """
    if degree == 0:
        return ((u >= 0) & (u < 1)).astype(u.dtype)
    left, right = bspline(u, degree - 1), bspline(u - 1, degree - 1)
    return (u * left + (degree + 1 - u) * right) / degree


def slope(u, degree):
    """dN/du = N_{k-1}(u) - N_{k-1}(u - 1)."""
    return bspline(u, degree - 1) - bspline(u - 1, degree - 1)


class Pairs(NamedTuple):
    """All pairs ip of a particle p and one of the S = (degree + 1)^d nodes i that it reaches."""

    node: np.ndarray     # (N, S, d)  integer coordinates of the node, which lies at node * dx
    w: np.ndarray        # (N, S)     weight prod_a N((x_p - x_i)_a / dx), N centred
    dw: np.ndarray       # (N, S, d)  its gradient with respect to x_p [1/m]
    r: np.ndarray        # (N, S, d)  x_i - x_p [m]


def pairs(x, dx, degree):
    """Pairs of particles at x (N, d) [m] and nodes of a grid of spacing dx (LDM-sec2.2-spaces)."""
    d, half = x.shape[1], x.dtype.type(degree + 1) / 2
    base = np.floor(x / dx - (half - 1)).astype(int)
    node = base[:, None] + np.array(list(np.ndindex(*d * (degree + 1,))))
    u = x[:, None] / dx - node.astype(x.dtype)
    n, dn = bspline(u + half, degree), slope(u + half, degree)
    dw = [np.prod(np.where(np.arange(d) == a, dn, n), axis=-1) for a in range(d)]
    return Pairs(node, np.prod(n, axis=-1), np.stack(dw, axis=-1) / dx, -u * dx)
