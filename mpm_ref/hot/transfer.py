"""Velocity gradients from nodes and forces back to nodes: sums that are each other's transpose.

    T_p = sum_i u_i dw_ip^T       a velocity gradient (NSF-alg-mpm step 3, the gradient form)
    f_i = sum_p T_p dw_ip         a force, for T_p = -V0_p P_p (F_p^n)^T (HOT-eq2)

Nodes are those of a box: u is `grid.v`, f is `grid.f`. Forces are added slab by slab in two
colours, so that they are the same to the bit for any number of threads (see `core.order`).
`largest_velocity` is the largest velocity that nodes give to a particle.
"""

from math import inf, isfinite, sqrt

import numpy as np

from ..core.jit import CHUNKS, chunk, kernel, parallel, prange
from ..core.lines import node_number, strides
from ..core.stencil import (
    add_to_node,
    column,
    columns,
    gradient,
    node,
    of_node,
    product,
    slopes_per_axis,
    weights_per_axis,
)
from ..core.tensor import dot, fill, lin, mat, mlin, mv, outer, put_mat, transpose, vec, vm
from ..core.transfer_mls3 import add_momenta, plane, weighted


@kernel
def gather(points, grid, stencil, bounds):
    """T_p = sum_i u_i dw_ip^T for the particles bounds[0] .. bounds[1] - 1."""
    d = grid.m.shape
    for p in range(bounds[0], bounds[1]):
        base, s = vec(points.base, p, d), vec(points.s, p, d)
        w, dw = weights_per_axis(s, stencil), slopes_per_axis(s, stencil)
        T = outer(fill(0.0, s), s)
        for c in range(columns(s, stencil)):
            k = column(c, stencil, d)
            for l in range(len(stencil)):
                u_i = of_node(grid.v, node(base, k, l))
                T = mlin(1.0, T, 1.0, outer(u_i, gradient(k, l, w, dw, grid.dx)))
        put_mat(points.T, p, T)


@kernel
def scatter(points, grid, stencil, bounds):
    """f_i += sum_p T_p dw_ip for the particles bounds[0] .. bounds[1] - 1."""
    d = grid.m.shape
    for p in range(bounds[0], bounds[1]):
        base, s, T = vec(points.base, p, d), vec(points.s, p, d), mat(points.T, p, d)
        w, dw = weights_per_axis(s, stencil), slopes_per_axis(s, stencil)
        for c in range(columns(s, stencil)):
            k = column(c, stencil, d)
            for l in range(len(stencil)):
                f_ip = mv(T, gradient(k, l, w, dw, grid.dx))
                add_to_node(grid.f, node(base, k, l), f_ip)


@parallel
def _gather_all(points, grid, stencil):
    for c in prange(CHUNKS):
        gather(points, grid, stencil, chunk(c, len(points.T)))


@parallel
def _scatter_color(points, grid, stencil, color):
    for h in prange((len(points.slab) - color) // 2):
        a = 2 * h + color
        scatter(points, grid, stencil, (points.slab[a], points.slab[a + 1]))


def gradients(points, grid, stencil):
    """`gather` for all particles of a body: points.T from grid.v."""
    run = gather3_all if _has_fast_twin(grid, stencil) else _gather_all
    run(points, grid, stencil)


def add_forces(points, grid, stencil):
    """`scatter` for all particles of a body: grid.f from points.T."""
    run = scatter3_color if _has_fast_twin(grid, stencil) else _scatter_color
    for color in (0, 1):
        run(points, grid, stencil, color)


def _has_fast_twin(grid, stencil):
    return grid.m.ndim == 3 and len(stencil) == 3


# quadratic splines in 3D, written for speed: the same sums, line by line
#
# As in `core.transfer_mls3`, three nodes along the last axis hold nine consecutive numbers, a 3 x 3
# matrix with a row for each node; the 27 nodes are nine such lines. A slope dw_ip is a product of
# factors by axis, so that sums over the lines of a plane, then over planes, are shared by its three
# components; and the force T_p dw_ip on a line is a combination of three outer products.


@kernel
def gather3(points, grid, stencil, bounds):
    """`gather` for a quadratic stencil in 3D."""
    u, n, d = grid.v.reshape(-1), strides(grid.m), grid.m.shape
    for p in range(bounds[0], bounds[1]):
        w, dw = factors(vec(points.s, p, d), grid.dx, stencil)
        i = node_number(vec(points.base, p, d), n)
        A, dA = plane(u, i, n[1], w[1], dw[1])
        B, dB = plane(u, i + n[0], n[1], w[1], dw[1])
        C, dC = plane(u, i + n[0] + n[0], n[1], w[1], dw[1])
        x, y, z = weighted(dw[0], A, B, C), weighted(w[0], dA, dB, dC), weighted(w[0], A, B, C)
        put_mat(points.T, p, transpose((vm(w[2], x), vm(w[2], y), vm(dw[2], z))))


@kernel
def scatter3(points, grid, stencil, bounds):
    """`scatter` for a quadratic stencil in 3D."""
    f, n, d = grid.f.reshape(-1), strides(grid.m), grid.m.shape
    for p in range(bounds[0], bounds[1]):
        w, dw = factors(vec(points.s, p, d), grid.dx, stencil)
        x, y, z = transpose(mat(points.T, p, d))
        X, Y, Z = outer(w[2], x), outer(w[2], y), outer(dw[2], z)
        i = node_number(vec(points.base, p, d), n)
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
def gather3_all(points, grid, stencil):
    """`gather3` for all particles, in parallel."""
    for c in prange(CHUNKS):
        gather3(points, grid, stencil, chunk(c, len(points.T)))


@parallel
def scatter3_color(points, grid, stencil, color):
    """`scatter3` for the slabs of one colour, in parallel."""
    for h in prange((len(points.slab) - color) // 2):
        a = 2 * h + color
        scatter3(points, grid, stencil, (points.slab[a], points.slab[a + 1]))


# the largest velocity of a particle
#
# Nodes of little mass may move far without meaning, so that norms over nodes mislead; a step hands
# on its particles.


@kernel
def largest_square(points, grid, stencil, bounds):
    """max_p |sum_i w_ip u_i|^2 of the particles bounds[0] .. bounds[1] - 1; u is grid.v. Infinite
    where u is no number.
    """
    d, most = grid.m.shape, 0.0
    for p in range(bounds[0], bounds[1]):
        base, s = vec(points.base, p, d), vec(points.s, p, d)
        w, u = weights_per_axis(s, stencil), fill(0.0, s)
        for c in range(columns(s, stencil)):
            k = column(c, stencil, d)
            for l in range(len(stencil)):
                u = lin(1.0, u, product(k, l, w), of_node(grid.v, node(base, k, l)))
        far = dot(u, u)
        most = max(most, far) if isfinite(far) else inf
    return most


@parallel
def _largest_square_all(points, grid, stencil, out):
    for c in prange(CHUNKS):
        out[c] = largest_square(points, grid, stencil, chunk(c, len(points.T)))


def largest_velocity(points, grid, stencil):
    """max_p |sum_i w_ip u_i| of a body's points, u being `grid.v`; in the unit of u."""
    out = np.empty(CHUNKS)
    _largest_square_all(points, grid, stencil, out)
    return sqrt(out.max())
