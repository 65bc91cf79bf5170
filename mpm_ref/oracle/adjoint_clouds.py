"""Pairs of particles and nodes with the second derivatives of their weights, and all scales."""

from functools import partial
from math import prod
from typing import NamedTuple

import numpy as np

from ..plain.spline import bspline, slope
from . import scales
from .known import Known, given, known


class Cloud(NamedTuple):
    """The pairs of a body (see `plain.spline.Pairs`), with second derivatives; all `Known`."""

    node: np.ndarray    # (N, S, d)
    w: Known            # (N, S)
    dw: Known           # (N, S, d)     [1/m]
    r: Known            # (N, S, d)     [m]
    ddw: Known          # (N, S, d, d)  [1/m^2]


def cloud(ip, method, S_x):
    """`Cloud` of the pairs of positions with the scales S_x (N,) [m]."""
    W = scales.weights(ip, method, S_x)
    return Cloud(ip.node, given(ip.w, W.w), given(ip.dw, W.dw), given(ip.r, W.r),
                 curvature(ip, method, S_x))


def curvature(ip, method, S_x):
    """d2 w_ip/dx_p^2, `Known`. No derivative of a factor exceeds its number, of degrees 1 to 3."""
    u = -ip.r / method.dx + (method.degree + 1) / method.dx.dtype.type(2)
    S_u = (1 + S_x[:, None, None] / method.dx) + 0 * u
    factors = [f(u, method.degree) for f in (bspline, slope, second)]
    factors = [given(a, abs(a) + k * S_u) for k, a in enumerate(factors, 1)]
    d = u.shape[2]
    rows = [[known(partial(mixed, a=a, b=b), *factors) for b in range(d)] for a in range(d)]
    return Known(*(np.moveaxis(np.array([[entry[k] for entry in row] for row in rows]), (0, 1),
                               (2, 3)) / method.dx**2 for k in (0, 1)))


def mixed(n, dn, ddn, a, b):
    """d2/du_a du_b of the product of the factors n (N, S, d)."""
    def factor(c):
        return (ddn if a == b else dn) if c in (a, b) else n

    return prod(factor(c)[..., c] for c in range(n.shape[2]))


def second(u, degree):
    """d2N/du2 of the B-spline (see `plain.spline.slope`); 0 for degree 1."""
    return slope(u, degree - 1) - slope(u - 1, degree - 1) if degree > 1 else 0 * u
