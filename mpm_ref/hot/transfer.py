"""Velocity gradients from nodes and forces back to nodes: sums that are each other's transpose.

    T_p = sum_i u_i dw_ip^T       a velocity gradient (NSF-alg-mpm step 3, the gradient form)
    f_i = sum_p T_p dw_ip         a force, for T_p = -V0_p P_p (F_p^n)^T (HOT-eq2)

Nodes are those of a box: u is `grid.v`, f is `grid.f`. Forces are added slab by slab in two
colours, so that they are the same to the bit for any number of threads (see `core.order`).
"""

from ..core.jit import CHUNKS, chunk, kernel, parallel, prange
from ..core.stencil import (
    add_to_node,
    column,
    columns,
    gradient,
    node,
    of_node,
    slopes_per_axis,
    weights_per_axis,
)
from ..core.tensor import fill, mat, mlin, mv, outer, put_mat, vec
from .exchange3 import gather3_all, scatter3_color


@kernel
def gather(sites, grid, stencil, bounds):
    """T_p = sum_i u_i dw_ip^T for the particles bounds[0] .. bounds[1] - 1."""
    d = grid.m.shape
    for p in range(bounds[0], bounds[1]):
        base, s = vec(sites.base, p, d), vec(sites.s, p, d)
        w, dw = weights_per_axis(s, stencil), slopes_per_axis(s, stencil)
        T = outer(fill(0.0, s), s)
        for c in range(columns(s, stencil)):
            k = column(c, stencil, d)
            for l in range(len(stencil)):
                u_i = of_node(grid.v, node(base, k, l))
                T = mlin(1.0, T, 1.0, outer(u_i, gradient(k, l, w, dw, grid.dx)))
        put_mat(sites.T, p, T)


@kernel
def scatter(sites, grid, stencil, bounds):
    """f_i += sum_p T_p dw_ip for the particles bounds[0] .. bounds[1] - 1."""
    d = grid.m.shape
    for p in range(bounds[0], bounds[1]):
        base, s, T = vec(sites.base, p, d), vec(sites.s, p, d), mat(sites.T, p, d)
        w, dw = weights_per_axis(s, stencil), slopes_per_axis(s, stencil)
        for c in range(columns(s, stencil)):
            k = column(c, stencil, d)
            for l in range(len(stencil)):
                f_ip = mv(T, gradient(k, l, w, dw, grid.dx))
                add_to_node(grid.f, node(base, k, l), f_ip)


@parallel
def _gather_all(sites, grid, stencil):
    for c in prange(CHUNKS):
        gather(sites, grid, stencil, chunk(c, len(sites.T)))


@parallel
def _scatter_color(sites, grid, stencil, color):
    for h in prange((len(sites.slab) - color) // 2):
        a = 2 * h + color
        scatter(sites, grid, stencil, (sites.slab[a], sites.slab[a + 1]))


def gradients(sites, grid, stencil):
    """`gather` for all particles of a body: sites.T from grid.v."""
    run = gather3_all if _has_fast_twin(grid, stencil) else _gather_all
    run(sites, grid, stencil)


def add_forces(sites, grid, stencil):
    """`scatter` for all particles of a body: grid.f from sites.T."""
    run = scatter3_color if _has_fast_twin(grid, stencil) else _scatter_color
    for color in (0, 1):
        run(sites, grid, stencil, color)


def _has_fast_twin(grid, stencil):
    return grid.m.ndim == 3 and len(stencil) == 3
