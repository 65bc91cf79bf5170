"""`exchange` for quadratic splines in 3D, written for speed: the same sums, line by line.

As in `core.transfer_mls3`, three nodes along the last axis hold nine consecutive numbers, a 3 x 3
matrix with a row for each node; the 27 nodes are nine such lines. A slope dw_ip is a product of
factors by axis, so that sums over the lines of a plane, then over planes, are shared by its three
components; and the force T_p dw_ip on a line is a combination of three outer products.
"""

from ..core.jit import CHUNKS, chunk, kernel, parallel, prange
from ..core.stencil import slopes_per_axis, weights_per_axis
from ..core.tensor import lin, mat, outer, put_mat, transpose, vec, vm
from ..core.transfer_mls3 import add_momenta, node_number, plane, strides, weighted


@kernel
def gather3(sites, grid, stencil, bounds):
    """`gather` for a quadratic stencil in 3D."""
    u, n, d = grid.v.reshape(-1), strides(grid.m), grid.m.shape
    for p in range(bounds[0], bounds[1]):
        w, dw = factors(vec(sites.s, p, d), grid.dx, stencil)
        i = node_number(vec(sites.base, p, d), n)
        A, dA = plane(u, i, n[1], w[1], dw[1])
        B, dB = plane(u, i + n[0], n[1], w[1], dw[1])
        C, dC = plane(u, i + n[0] + n[0], n[1], w[1], dw[1])
        x, y, z = weighted(dw[0], A, B, C), weighted(w[0], dA, dB, dC), weighted(w[0], A, B, C)
        put_mat(sites.T, p, transpose((vm(w[2], x), vm(w[2], y), vm(dw[2], z))))


@kernel
def scatter3(sites, grid, stencil, bounds):
    """`scatter` for a quadratic stencil in 3D."""
    f, n, d = grid.f.reshape(-1), strides(grid.m), grid.m.shape
    for p in range(bounds[0], bounds[1]):
        w, dw = factors(vec(sites.s, p, d), grid.dx, stencil)
        x, y, z = transpose(mat(sites.T, p, d))
        X, Y, Z = outer(w[2], x), outer(w[2], y), outer(dw[2], z)
        i = node_number(vec(sites.base, p, d), n)
        for a in range(3):
            j = i
            for b in range(3):
                share = dw[0][a] * w[1][b], w[0][a] * dw[1][b], w[0][a] * w[1][b]
                add_momenta(f, j + j + j, 1.0, weighted(share, X, Y, Z))
                j += n[1]
            i += n[0]


@kernel
def factors(s, dx, stencil):
    """Weights, and slopes [1/m], by axis."""
    w, dw = weights_per_axis(s, stencil), slopes_per_axis(s, stencil)
    h = 1.0 / dx
    return w, (lin(h, dw[0], 0.0, s), lin(h, dw[1], 0.0, s), lin(h, dw[2], 0.0, s))


@parallel
def gather3_all(sites, grid, stencil):
    """`gather3` for all particles, in parallel."""
    for c in prange(CHUNKS):
        gather3(sites, grid, stencil, chunk(c, len(sites.T)))


@parallel
def scatter3_color(sites, grid, stencil, color):
    """`scatter3` for the slabs of one colour, in parallel."""
    for h in prange((len(sites.slab) - color) // 2):
        a = 2 * h + color
        scatter3(sites, grid, stencil, (sites.slab[a], sites.slab[a + 1]))
