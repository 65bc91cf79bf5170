"""B-splines of degree 1, 2, 3 on a grid of spacing dx, and the nodes they reach.

The degree is the length of `stencil` minus one: (0, 1), (0, 1, 2), (0, 1, 2, 3) are the offsets
of the nodes that a point reaches from its base node, per axis. A stencil `Gimp` reaches the nodes
of degree 2, with other weights; `MlsQuadratic` and `MlsCubic` have other slopes.
"""

from math import floor

from .gimp import Gimp, gimp_slopes, gimp_weights
from .jit import by_type, kernel
from .mls_slopes import MlsCubic, MlsQuadratic, mls_slope

STENCILS = {1: (0, 1), 2: (0, 1, 2), 3: (0, 1, 2, 3)}

three_weights = by_type("three_weights")        # (f, stencil) -> weights of three nodes
three_slopes = by_type("three_slopes")          # (f, stencil) -> slopes of three nodes
four_slopes = by_type("four_slopes")            # (f, stencil) -> slopes of four nodes


@kernel
def quadratic_weights(f, stencil):
    """Weights of the quadratic B-splines; see `weights`."""
    return 0.5 * (1.5 - f) ** 2, 0.75 - (f - 1.0) ** 2, 0.5 * (f - 0.5) ** 2


@kernel
def quadratic_slopes(f, stencil):
    """Slopes of the quadratic B-splines; see `slopes`."""
    return f - 1.5, 2.0 - 2.0 * f, f - 0.5


@kernel
def cubic_weights(f):
    """Weights of the cubic B-splines; see `weights`."""
    return (
        (2.0 - f) ** 3 / 6.0,
        2.0 / 3.0 - (f - 1.0) ** 2 * (1.5 - 0.5 * f),
        2.0 / 3.0 - (2.0 - f) ** 2 * (0.5 * f),
        (f - 1.0) ** 3 / 6.0,
    )


@kernel
def cubic_slopes(f, stencil):
    """Slopes of the cubic B-splines; see `slopes`."""
    return (
        -0.5 * (2.0 - f) ** 2,
        (f - 1.0) * (1.5 * f - 3.5),
        (2.0 - f) * (1.5 * f - 1.0),
        0.5 * (f - 1.0) ** 2,
    )


@kernel
def mls_quadratic_slopes(f, stencil):
    """`mls_slope` of three nodes."""
    a, b, c = quadratic_weights(f, stencil)
    return mls_slope(a, 0, f, stencil), mls_slope(b, 1, f, stencil), mls_slope(c, 2, f, stencil)


@kernel
def mls_cubic_slopes(f, stencil):
    """`mls_slope` of four nodes."""
    a, b, c, d = cubic_weights(f)
    return (mls_slope(a, 0, f, stencil), mls_slope(b, 1, f, stencil),
            mls_slope(c, 2, f, stencil), mls_slope(d, 3, f, stencil))


three_weights.method(tuple, quadratic_weights)
three_weights.method(Gimp, gimp_weights)
three_weights.method(MlsQuadratic, quadratic_weights)
three_slopes.method(tuple, quadratic_slopes)
three_slopes.method(MlsQuadratic, mls_quadratic_slopes)
four_slopes.method(tuple, cubic_slopes)
four_slopes.method(MlsCubic, mls_cubic_slopes)
three_slopes.method(Gimp, gimp_slopes)


@kernel
def base_of(x, dx, stencil):
    """First node that a point at coordinate x reaches on one axis: floor(x/dx - (degree - 1)/2)."""
    return floor(x / dx - 0.5 * (len(stencil) - 2))


@kernel
def weights(f, stencil):
    """N(f - k) for the nodes k = 0 .. degree of one axis; f = x/dx - base in [(degree-1)/2,
    (degree+1)/2).
    """
    if len(stencil) == 2:
        return 1.0 - f, f
    elif len(stencil) == 3:
        return three_weights(f, stencil)
    else:
        return cubic_weights(f)


@kernel
def slopes(f, stencil):
    """N'(f - k) for the same nodes: derivative with respect to f = x/dx - base."""
    if len(stencil) == 2:
        return -1.0, 1.0
    elif len(stencil) == 3:
        return three_slopes(f, stencil)
    else:
        return four_slopes(f, stencil)
