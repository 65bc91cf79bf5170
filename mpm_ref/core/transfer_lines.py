"""The transfers, written for speed: all forms and splines but those of `transfer_mls3`.

The same sums as `scatter`, `scatter_mls`, `gather` and `gather_mls` of `transfer`, by lines of
nodes (see `lines`): in 3D from twice (MLS that relaxes) to 17 times (cubic PIC) as fast.
"""

from .jit import CHUNKS, chunk, kernel, leaf, parallel_if_many, prange
from .lines import (
    NodeLines,
    affine_rows,
    arms_per_axis,
    both_sums_of,
    by_plane,
    force_rows,
    mean_of,
    node_number,
    plus,
    rows,
    spread,
    spread_all,
    spread_force,
    spread_mass,
    strides,
    sums_of,
    times,
)
from .relaxation import blend, blend_moment, moment, shift_spin
from .state import affine, body_force, full, put_affine
from .stencil import inverse_inertia, locate, slopes_per_axis, weights_per_axis
from .tensor import lin, mlin, mv, outer, put_mat, put_vec, scale, vec


@kernel
def reached(x, grid, stencil):
    """The `NodeLines` of a particle at x."""
    base, s = locate(x, grid, stencil)
    w, n = weights_per_axis(s, stencil), strides(grid.m)
    dw, r = by_plane(slopes_per_axis(s, stencil), 0.0), by_plane(arms_per_axis(w, s), 0.0)
    return NodeLines(node_number(base, n), n, by_plane(w, 1.0), dw, r, s)


# particles to grid

@kernel
def scatter_lines(particles, grid, stencil, dt, members):
    """`transfer.scatter`, the gradient form."""
    m, v, f = grid.m.reshape(-1), grid.v.reshape(-1), grid.f.reshape(-1)
    for p in members:
        nodes = reached(vec(particles.x, p, grid.m.shape), grid, stencil)
        m_p, tau = particles.m[p], full(particles.tau, p, nodes.s)
        mv_p = times(m_p, vec(particles.v, p, nodes.s))
        mb_p = times(m_p, body_force(particles.b, p, nodes.s))
        V = particles.V0[p] / grid.dx
        if grid.f.ndim == 1:
            A = momentum_rows(particles.C, p, lin(1.0, mv_p, dt, mb_p), m_p * grid.dx, nodes)
            S = force_rows(scale(-dt * V, tau), nodes.w[2], nodes.dw[2])
            spread_all(m, v, m_p, A, S, nodes)
        else:
            spread_mass(m, m_p, nodes)
            spread(v, momentum_rows(particles.C, p, mv_p, m_p * grid.dx, nodes), nodes)
            S, S_x, S_y = force_rows(scale(-V, tau), nodes.w[2], nodes.dw[2])
            spread_force(f, (plus(S, 1.0, rows(nodes.w[2], mb_p)), S_x, S_y), nodes)


@kernel
def scatter_lines_mls(particles, grid, stencil, dt, members):
    """`transfer.scatter_mls`, the MLS form."""
    m, v, f = grid.m.reshape(-1), grid.v.reshape(-1), grid.f.reshape(-1)
    for p in members:
        nodes = reached(vec(particles.x, p, grid.m.shape), grid, stencil)
        m_p, tau = particles.m[p], full(particles.tau, p, nodes.s)
        mv_p, C = times(m_p, vec(particles.v, p, nodes.s)), affine(particles.C, p, nodes.s)
        mb_p = times(m_p, body_force(particles.b, p, nodes.s))
        V = inverse_inertia(grid.dx, stencil) * particles.V0[p] * grid.dx
        spread_mass(m, m_p, nodes)
        if grid.f.ndim == 1:
            Q = mlin(m_p * grid.dx, C, -dt * V, tau)
            spread(v, rows_about(lin(1.0, mv_p, dt, mb_p), Q, nodes), nodes)
        else:
            spread(v, rows_about(mv_p, scale(m_p * grid.dx, C), nodes), nodes)
            spread(f, rows_about(mb_p, scale(-V, tau), nodes), nodes)


@kernel
def rows_about(x_p, Q, nodes):
    """`affine_rows` of the field x_p + Q (k - s) of the nodes k, which is x_p at the particle."""
    return affine_rows(lin(1.0, x_p, -1.0, mv(Q, nodes.s)), Q, nodes.w[2])


@kernel
def momentum_rows(C, p, mv_p, m_dx, nodes):
    """Rows of the momentum m_p (v_p + C_p r_ip); of a constant field where no C is carried."""
    if C.ndim == 3:
        return rows_about(mv_p, scale(m_dx, affine(C, p, nodes.s)), nodes)
    else:
        return (rows(nodes.w[2], mv_p),)


# grid to particles

@kernel
def gather_lines(particles, grid, stencil, dt, flip, bounds):
    """`transfer.gather`, the gradient form."""
    v = grid.v.reshape(-1)
    for p in range(bounds[0], bounds[1]):
        x = vec(particles.x, p, grid.m.shape)
        nodes = reached(x, grid, stencil)
        u, L, B = sums_with_moment(particles.C, v, nodes)
        put_vec(particles.x, p, lin(1.0, x, dt, u))
        put_mat(particles.L, p, scale(1.0 / grid.dx, L))
        put_relaxed(particles, p, grid, (stencil, dt, flip), (u, B), nodes)


@kernel
def gather_lines_mls(particles, grid, stencil, dt, flip, bounds):
    """`transfer.gather_mls`, the MLS form."""
    v, growth = grid.v.reshape(-1), grid.dx * inverse_inertia(grid.dx, stencil)
    for p in range(bounds[0], bounds[1]):
        x = vec(particles.x, p, grid.m.shape)
        nodes = reached(x, grid, stencil)
        u, B = sums_of(v, nodes.r, nodes)
        put_vec(particles.x, p, lin(1.0, x, dt, u))
        if grid.v_old.ndim > 1:
            put_affine(particles.L, p, growth, B)
        put_relaxed(particles, p, grid, (stencil, dt, flip), (u, B), nodes)


@kernel
def sums_with_moment(C, v, nodes):
    """u, L dx and the moment B/dx of the grid's velocity; no moment where no C is carried."""
    if C.ndim == 3:
        return both_sums_of(v, nodes)
    else:
        u, L = sums_of(v, nodes.dw, nodes)
        return u, L, L


@leaf
def put_relaxed(particles, p, grid, step, sums, nodes):
    """v_p and C_p from the grid's u and moment B/dx, `sums`; where v_old is carried, with the share
    `flip` of their own lag behind it (see `transfer.gather`). step: (stencil, dt, flip).
    """
    stencil, dt, flip = step
    u, D_inv = sums[0], inverse_inertia(grid.dx, stencil)
    B = scale(grid.dx, sums[1])
    if grid.v_old.ndim > 1:
        u_old, B_old = old_sums(particles.C, grid.v_old.reshape(-1), nodes)
        lag = lin(1.0, vec(particles.v, p, u), -1.0, u_old)
        lag_B = mlin(1.0, moment(particles.C, p, 1.0 / D_inv, u), -grid.dx, B_old)
        B = blend_moment(B, flip, lag_B, shift_spin(u, lag, flip, dt), grid.v_old)
        u = blend(u, flip, lag, grid.v_old)
    put_affine(particles.C, p, D_inv, B)
    put_vec(particles.v, p, u)


@leaf
def old_sums(C, v_old, nodes):
    """Mean and moment of the old velocity; no moment where no C is carried."""
    if C.ndim == 3:
        return sums_of(v_old, nodes.r, nodes)
    else:
        u = mean_of(v_old, nodes)
        return u, outer(u, u)


# all particles

@parallel_if_many
def scatter_lines_color(particles, grid, stencil, dt, slabs, color):
    """`scatter_lines` for the slabs of one colour, in parallel."""
    for h in prange((len(slabs.start) - color) // 2):
        a = 2 * h + color
        members = slabs.order[slabs.start[a] : slabs.start[a + 1]]
        scatter_lines(particles, grid, stencil, dt, members)


@parallel_if_many
def scatter_lines_mls_color(particles, grid, stencil, dt, slabs, color):
    """`scatter_lines_mls` for the slabs of one colour, in parallel."""
    for h in prange((len(slabs.start) - color) // 2):
        a = 2 * h + color
        members = slabs.order[slabs.start[a] : slabs.start[a + 1]]
        scatter_lines_mls(particles, grid, stencil, dt, members)


@parallel_if_many
def gather_lines_all(particles, grid, stencil, dt, flip):
    """`gather_lines` for all particles, in parallel."""
    for c in prange(CHUNKS):
        gather_lines(particles, grid, stencil, dt, flip, chunk(c, len(particles.x)))


@parallel_if_many
def gather_lines_mls_all(particles, grid, stencil, dt, flip):
    """`gather_lines_mls` for all particles, in parallel."""
    for c in prange(CHUNKS):
        gather_lines_mls(particles, grid, stencil, dt, flip, chunk(c, len(particles.x)))
