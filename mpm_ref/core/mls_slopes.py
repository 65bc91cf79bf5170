"""Stencils whose slopes are those of the MLS form: G_ip = D^-1 w_ip r_ip in place of dw_ip.

Force and velocity gradient of MLS-MPM (see `transfer`) are those of the gradient form with G_ip for
dw_ip. Its component along an axis is a product of the weights of the other axes and of a factor,
as that of dw_ip is: w_k (k - f) 12/(degree + 1), with f = x/dx - base. Hence a loop that takes
`slopes` from these stencils computes the MLS form. Weights and nodes are those of the splines.
"""

from typing import NamedTuple

from .jit import kernel
from .tensor import number


class MlsQuadratic(NamedTuple):
    """The offsets of quadratic splines."""

    first: int = 0
    second: int = 1
    third: int = 2


class MlsCubic(NamedTuple):
    """The offsets of cubic splines."""

    first: int = 0
    second: int = 1
    third: int = 2
    fourth: int = 3


def mls_stencil(degree):
    """Return the stencil of splines of degree 2 or 3 with the slopes of the MLS form."""
    return {2: MlsQuadratic, 3: MlsCubic}[degree]()


@kernel
def mls_slope(w, k, f, stencil):
    """w_k (k - f) 12/(degree + 1) of the weight w of the node k."""
    return w * (number(k, f) - f) * (12.0 / number(len(stencil), f))
