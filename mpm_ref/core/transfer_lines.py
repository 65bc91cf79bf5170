"""The transfers, written for speed: all forms and splines but those of `transfer_mls3`.

The same sums as `scatter`, `scatter_mls`, `gather` and `gather_mls` of `transfer`, by lines of
nodes (see `lines`): 3 to 18 times as fast in 3D.
"""

from .jit import CHUNKS, chunk, kernel, leaf, parallel, prange
from .lines import (
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

# particles to grid

@kernel
def scatter_lines(particles, grid, stencil, dt, members):
    """`transfer.scatter`, the gradient form."""
    m, v, f = grid.m.reshape(-1), grid.v.reshape(-1), grid.f.reshape(-1)
    n = strides(grid.m)
    for p in members:
        base, s = locate(vec(particles.x, p, grid.m.shape), grid, stencil)
        w = by_plane(weights_per_axis(s, stencil), 1.0)
        dw = by_plane(slopes_per_axis(s, stencil), 0.0)
        i, m_p, tau = node_number(base, n), particles.m[p], full(particles.tau, p, s)
        mv_p = times(m_p, vec(particles.v, p, s))
        mb_p = times(m_p, body_force(particles.b, p, s))
        V = particles.V0[p] / grid.dx
        if grid.f.ndim == 1:
            A = momentum_rows(particles.C, p, lin(1.0, mv_p, dt, mb_p), m_p * grid.dx, s, w[2])
            S = force_rows(scale(-dt * V, tau), w[2], dw[2])
            spread_all(m, v, i, n, w, dw, m_p, A, S, s)
        else:
            spread_mass(m, i, n, w, m_p)
            spread(v, i, n, w, momentum_rows(particles.C, p, mv_p, m_p * grid.dx, s, w[2]), s)
            S, S_x, S_y = force_rows(scale(-V, tau), w[2], dw[2])
            spread_force(f, i, n, w, dw, (plus(S, 1.0, rows(w[2], mb_p)), S_x, S_y), s)


@kernel
def scatter_lines_mls(particles, grid, stencil, dt, members):
    """`transfer.scatter_mls`, the MLS form."""
    m, v, f = grid.m.reshape(-1), grid.v.reshape(-1), grid.f.reshape(-1)
    n = strides(grid.m)
    for p in members:
        base, s = locate(vec(particles.x, p, grid.m.shape), grid, stencil)
        w = by_plane(weights_per_axis(s, stencil), 1.0)
        i, m_p, tau = node_number(base, n), particles.m[p], full(particles.tau, p, s)
        mv_p, C = times(m_p, vec(particles.v, p, s)), affine(particles.C, p, s)
        mb_p = times(m_p, body_force(particles.b, p, s))
        V = inverse_inertia(grid.dx, stencil) * particles.V0[p] * grid.dx
        spread_mass(m, i, n, w, m_p)
        if grid.f.ndim == 1:
            Q = mlin(m_p * grid.dx, C, -dt * V, tau)
            spread(v, i, n, w, rows_about(lin(1.0, mv_p, dt, mb_p), Q, s, w[2]), s)
        else:
            Q = scale(m_p * grid.dx, C)
            spread(v, i, n, w, rows_about(mv_p, Q, s, w[2]), s)
            spread(f, i, n, w, rows_about(mb_p, scale(-V, tau), s, w[2]), s)


@kernel
def rows_about(x_p, Q, s, w):
    """`affine_rows` of the field x_p + Q (k - s) of the nodes k, which is x_p at the particle."""
    return affine_rows(lin(1.0, x_p, -1.0, mv(Q, s)), Q, w)


@kernel
def momentum_rows(C, p, mv_p, m_dx, s, w):
    """Rows of the momentum m_p (v_p + C_p r_ip); of a constant field where no C is carried."""
    if C.ndim == 3:
        return rows_about(mv_p, scale(m_dx, affine(C, p, s)), s, w)
    else:
        return (rows(w, mv_p),)


# grid to particles

@kernel
def gather_lines(particles, grid, stencil, dt, flip, bounds):
    """`transfer.gather`, the gradient form."""
    v, n = grid.v.reshape(-1), strides(grid.m)
    for p in range(bounds[0], bounds[1]):
        x = vec(particles.x, p, grid.m.shape)
        base, s = locate(x, grid, stencil)
        w = weights_per_axis(s, stencil)
        r = by_plane(arms_per_axis(w, s), 0.0)
        w, dw = by_plane(w, 1.0), by_plane(slopes_per_axis(s, stencil), 0.0)
        i = node_number(base, n)
        u, L, B = sums_with_moment(particles.C, v, i, n, w, dw, r, s)
        put_vec(particles.x, p, lin(1.0, x, dt, u))
        put_mat(particles.L, p, scale(1.0 / grid.dx, L))
        put_relaxed(particles, p, grid, stencil, dt, flip, u, B, (i, n, w, r))


@kernel
def gather_lines_mls(particles, grid, stencil, dt, flip, bounds):
    """`transfer.gather_mls`, the MLS form."""
    v, n = grid.v.reshape(-1), strides(grid.m)
    growth = grid.dx * inverse_inertia(grid.dx, stencil)
    for p in range(bounds[0], bounds[1]):
        x = vec(particles.x, p, grid.m.shape)
        base, s = locate(x, grid, stencil)
        w = weights_per_axis(s, stencil)
        w, r = by_plane(w, 1.0), by_plane(arms_per_axis(w, s), 0.0)
        i = node_number(base, n)
        u, B = sums_of(v, i, n, w, r, s)
        put_vec(particles.x, p, lin(1.0, x, dt, u))
        if grid.v_old.ndim > 1:
            put_affine(particles.L, p, growth, B)
        put_relaxed(particles, p, grid, stencil, dt, flip, u, B, (i, n, w, r))


@kernel
def sums_with_moment(C, v, i, n, w, dw, r, like):
    """u, L dx and the moment B/dx of the grid's velocity; no moment where no C is carried."""
    if C.ndim == 3:
        return both_sums_of(v, i, n, w, dw, r, like)
    else:
        u, L = sums_of(v, i, n, w, dw, like)
        return u, L, L


@leaf
def put_relaxed(particles, p, grid, stencil, dt, flip, u, B, place):
    """v_p and C_p from the grid's u and moment B/dx; where v_old is carried, with the share `flip`
    of their own lag behind it (see `transfer.gather`). place: (i, n, w, r) of the sums.
    """
    D_inv = inverse_inertia(grid.dx, stencil)
    B = scale(grid.dx, B)
    if grid.v_old.ndim > 1:
        u_old, B_old = old_sums(particles.C, grid.v_old.reshape(-1), place, u)
        lag = lin(1.0, vec(particles.v, p, u), -1.0, u_old)
        lag_B = mlin(1.0, moment(particles.C, p, 1.0 / D_inv, u), -grid.dx, B_old)
        B = blend_moment(B, flip, lag_B, shift_spin(u, lag, flip, dt), grid.v_old)
        u = blend(u, flip, lag, grid.v_old)
    put_affine(particles.C, p, D_inv, B)
    put_vec(particles.v, p, u)


@leaf
def old_sums(C, v_old, place, like):
    """Mean and moment of the old velocity; no moment where no C is carried."""
    i, n, w, r = place
    if C.ndim == 3:
        return sums_of(v_old, i, n, w, r, like)
    else:
        u = mean_of(v_old, i, n, w, like)
        return u, outer(u, u)


# all particles

@parallel
def scatter_lines_color(particles, grid, stencil, dt, slabs, color):
    """`scatter_lines` for the slabs of one colour, in parallel."""
    for h in prange((len(slabs.start) - color) // 2):
        a = 2 * h + color
        members = slabs.order[slabs.start[a] : slabs.start[a + 1]]
        scatter_lines(particles, grid, stencil, dt, members)


@parallel
def scatter_lines_mls_color(particles, grid, stencil, dt, slabs, color):
    """`scatter_lines_mls` for the slabs of one colour, in parallel."""
    for h in prange((len(slabs.start) - color) // 2):
        a = 2 * h + color
        members = slabs.order[slabs.start[a] : slabs.start[a + 1]]
        scatter_lines_mls(particles, grid, stencil, dt, members)


@parallel
def gather_lines_all(particles, grid, stencil, dt, flip):
    """`gather_lines` for all particles, in parallel."""
    for c in prange(CHUNKS):
        gather_lines(particles, grid, stencil, dt, flip, chunk(c, len(particles.x)))


@parallel
def gather_lines_mls_all(particles, grid, stencil, dt, flip):
    """`gather_lines_mls` for all particles, in parallel."""
    for c in prange(CHUNKS):
        gather_lines_mls(particles, grid, stencil, dt, flip, chunk(c, len(particles.x)))
