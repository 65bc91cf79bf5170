"""The weights of uniform GIMP: linear splines averaged over the length of a particle.

A particle at x stands for the interval [x - l, x + l] of each axis, whatever its strain
[Bardenhagen2004] [SteffenWallstedt2008]. Its weights are the averages of the linear splines over
it: at most three nodes have one, and slopes are continuous where a particle crosses a node. With
l = dx/2 they are the quadratic B-splines.
"""

from typing import NamedTuple

from .jit import kernel


class Gimp(NamedTuple):
    """The stencil of GIMP, as long as that of quadratic splines: the coordinates f = x/dx - base
    between which the interval of a particle contains its middle node, and this node.
    """

    low: float          # 1 - l/dx
    middle: float       # 1
    high: float         # 1 + l/dx


def gimp_stencil(per_cell):
    """Return the `Gimp` of particles of which a number fills a cell along each axis."""
    half = 0.5 / per_cell
    return Gimp(1.0 - half, 1.0, 1.0 + half)


@kernel
def inside(f, stencil):
    """Return the nearest number to f in [low, high]."""
    return min(max(f, stencil.low), stencil.high)


@kernel
def gimp_weights(f, stencil):
    """Weights of the nodes 0, 1, 2 of one axis; f = x/dx - base in [1/2, 3/2)."""
    c, length = inside(f, stencil), stencil.high - stencil.low
    first = 0.5 * (stencil.high - c) ** 2 / length + max(stencil.low - f, 0.0)
    last = 0.5 * (c - stencil.low) ** 2 / length + max(f - stencil.high, 0.0)
    return first, 1.0 - first - last, last


@kernel
def gimp_slopes(f, stencil):
    """Derivatives of `gimp_weights` with respect to f."""
    c, length = inside(f, stencil), stencil.high - stencil.low
    first, last = (c - stencil.high) / length, (c - stencil.low) / length
    return first, -first - last, last


@kernel
def gimp_curvatures(f, stencil):
    """Derivatives of `gimp_slopes` with respect to f; at a kink that from above."""
    if stencil.low <= f < stencil.high:
        bend = 1.0 / (stencil.high - stencil.low)
    else:
        bend = 0.0
    return bend, -2.0 * bend, bend
