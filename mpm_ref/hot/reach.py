"""How far a nodal field carries the particles: max_p |sum_i w_ip u_i|.

Nodes of little mass may move far without meaning, so that norms over nodes mislead; particles are
what a step hands on.
"""

from math import inf, isfinite, sqrt

import numpy as np

from ..core.jit import CHUNKS, chunk, kernel, parallel, prange
from ..core.stencil import column, columns, node, of_node, product, weights_per_axis
from ..core.tensor import dot, fill, lin, vec


@kernel
def farthest(sites, grid, stencil, bounds):
    """max_p |sum_i w_ip u_i|^2 of the particles bounds[0] .. bounds[1] - 1; u is grid.v. Infinite
    where u is no number.
    """
    d, most = grid.m.shape, 0.0
    for p in range(bounds[0], bounds[1]):
        base, s = vec(sites.base, p, d), vec(sites.s, p, d)
        w, u = weights_per_axis(s, stencil), fill(0.0, s)
        for c in range(columns(s, stencil)):
            k = column(c, stencil, d)
            for l in range(len(stencil)):
                u = lin(1.0, u, product(k, l, w), of_node(grid.v, node(base, k, l)))
        far = dot(u, u)
        most = max(most, far) if isfinite(far) else inf
    return most


@parallel
def _farthest_all(sites, grid, stencil, out):
    for c in prange(CHUNKS):
        out[c] = farthest(sites, grid, stencil, chunk(c, len(sites.T)))


def reach(sites, grid, stencil):
    """max_p |sum_i w_ip u_i| of a body's `Sites`, u being `grid.v`; in the unit of u."""
    out = np.empty(CHUNKS)
    _farthest_all(sites, grid, stencil, out)
    return sqrt(out.max())
