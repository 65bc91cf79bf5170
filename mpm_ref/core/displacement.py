"""The largest speed of a particle after a step, read from the grid before a particle changes.

    |dx_p| = dt |sum_i w_ip v_i|

The velocity that moves a particle is a mean of those of its nodes, so that the largest nodal
velocity bounds it. Under FLIP the particle gets another velocity, which counts as well.
"""

from math import inf, isfinite, sqrt

import numpy as np

from .jit import CHUNKS, chunk, kernel, parallel, prange
from .precision import with_rounded_spacing
from .relaxation import blend
from .stencil import column, columns, locate, node, of_node, product, weights_per_axis
from .tensor import dot, fill, lin, vec
from .transfer import minus_old


@kernel
def largest_square(particles, grid, stencil, flip, bounds):
    """Largest square of a velocity after the step of the particles bounds[0] .. bounds[1] - 1;
    infinite where one is no number.
    """
    d, most = grid.m.shape, 0.0
    for p in range(bounds[0], bounds[1]):
        base, s = locate(vec(particles.x, p, d), grid, stencil)
        w, u, lag = weights_per_axis(s, stencil), fill(0.0, s), vec(particles.v, p, d)
        for c in range(columns(s, stencil)):
            k = column(c, stencil, d)
            for l in range(len(stencil)):
                i, w_ip = node(base, k, l), product(k, l, w)
                u = lin(1.0, u, w_ip, of_node(grid.v, i))
                lag = minus_old(lag, w_ip, grid.v_old, i)
        v = blend(u, flip, lag, grid.v_old)
        square = dot(u, u), dot(v, v)
        finite = isfinite(square[0]) and isfinite(square[1])
        most = max(most, square[0], square[1]) if finite else inf
    return most


@parallel
def _largest_square_all(particles, grid, stencil, flip, out):
    for c in prange(CHUNKS):
        out[c] = largest_square(particles, grid, stencil, flip, chunk(c, len(particles.x)))


def largest_speed(particles, grid, stencil, flip=0.0):
    """Return the largest speed [m/s] with which grid velocities move or leave a particle."""
    out, grid = np.empty(CHUNKS), with_rounded_spacing(grid)
    _largest_square_all(particles, grid, stencil, float(flip), out)
    return sqrt(out.max())


def speed_bound(grid, bodies):
    """Return a bound of `largest_speed` for all bodies, from extremes of arrays; NaN where an
    entry is.
    """
    bound = _largest_entry(grid.v)
    if grid.v_old.ndim > 1:
        change = _largest_entry(grid.v - grid.v_old)
        bound = max(bound, change + max(_largest_entry(body.particles.v) for body in bodies))
    return sqrt(grid.m.ndim) * bound


def _largest_entry(a):
    return max(float(a.max()), -float(a.min()))
