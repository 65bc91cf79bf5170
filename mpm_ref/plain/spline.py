"""B-splines by their recursion, and the weights of the nodes around a particle (LDM-sec2.2-spaces).

The weight of node i at particle p is a product over the axes a of a B-spline N of degree k:

    w_ip = prod_a N((x_p - x_i)_a / dx)

with N centred on the node; its support is k + 1 cells long. GIMP has other N, on the nodes of
degree 2 (see `gimp`).
"""

from typing import NamedTuple

import numpy as np

from .gimp import averaged, averaged_slope


def bspline(u, degree):
    """N(u) of the uniform B-spline with knots 0 .. degree + 1, by the recursion of Cox and de Boor.

    N_0(u) = 1 for 0 <= u < 1, else 0
    N_k(u) = (u N_{k-1}(u) + (k + 1 - u) N_{k-1}(u - 1)) / k

    u is an array of any shape, in cells from the first knot.
    """
    if degree == 0:
        return ((u >= 0) & (u < 1)).astype(u.dtype)
    left, right = bspline(u, degree - 1), bspline(u - 1, degree - 1)
    return (u * left + (degree + 1 - u) * right) / degree


def slope(u, degree):
    """dN/du = N_{k-1}(u) - N_{k-1}(u - 1), the derivative of `bspline`."""
    return bspline(u, degree - 1) - bspline(u - 1, degree - 1)


class Pairs(NamedTuple):
    """All pairs ip of N particles p with the S = (degree + 1)^d nodes i around each of them."""

    node: np.ndarray     # (N, S, d)  integer coordinates of node i, which lies at x_i = node * dx
    w: np.ndarray        # (N, S)     weight w_ip
    dw: np.ndarray       # (N, S, d)  its gradient with respect to x_p [1/m]
    r: np.ndarray        # (N, S, d)  r_ip = x_i - x_p [m]


def centred(u, degree, gimp=0):
    """Return N and dN/du at positions u from a node [cells]: of the B-spline of a degree, or of
    GIMP for a number `gimp` of particles per cell and axis.
    """
    if gimp:
        return averaged(u, gimp), averaged_slope(u, gimp)
    half = u.dtype.type(degree + 1) / 2
    return bspline(u + half, degree), slope(u + half, degree)


def pairs(x, dx, degree, gimp=0):
    """Return the `Pairs` of particles at x (N, d) [m] with the nodes of a grid of spacing dx [m];
    degree and gimp are those of `centred`.

    With u_a = (x_p - x_i)_a / dx the gradient is dw_ip,a = N'(u_a) prod_{b != a} N(u_b) / dx.
    """
    d, half = x.shape[1], x.dtype.type(degree + 1) / 2
    base = np.floor(x / dx - (half - 1)).astype(int)
    node = base[:, None] + np.array(list(np.ndindex(*d * (degree + 1,))))
    u = x[:, None] / dx - node.astype(x.dtype)
    n, dn = centred(u, degree, gimp)
    dw = [np.prod(np.where(np.arange(d) == a, dn, n), axis=-1) for a in range(d)]
    return Pairs(node, np.prod(n, axis=-1), np.stack(dw, axis=-1) / dx, -u * dx)
