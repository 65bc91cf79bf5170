"""Particle to grid and back: PIC, FLIP, APIC and MLS-MPM; degrees 1, 2, 3; 2D and 3D.

i is a node, p a particle, ip a pair: w_ip = N((x_p - x_i)/dx), dw_ip = dw_ip/dx_p, r_ip = x_i -
x_p. Velocity and test functions are spanned by the same splines (LDM-sec2.2-spaces), integrals are
sums over particles (LDM-eq8) and the mass is lumped (LDM-eq10); the sums of NSF-alg-mpm, LDM-alg1
and NCLAW-alg3 are special cases. There are two forms of force and velocity gradient:

    gradient form   f_i = -sum_p V0_p tau_p dw_ip             L_p = sum_i v_i dw_ip^T
    MLS form        f_i = -sum_p V0_p tau_p D^-1 w_ip r_ip    L_p = sum_i w_ip v_i r_ip^T D^-1 = C_p

with D = sum_i w_ip r_ip r_ip^T = dx^2 (degree + 1)/12 I, for degrees 2 and 3 only. Where an affine
transfer carries v_old on the grid, v and C relax to those of the grid, so that the filter of the
exchange acts per time, not per step (docs/explanation/transfers.md). `scatter*` and
`gather*` are the loops over particles, as plain as the sums are; `p2g` and `g2p` run in parallel
the same sums written for speed, `transfer_lines` and `transfer_mls3`, which are tested against
them. Which fields the particles and the grid carry (see `state`) selects the transfer, when the
kernel is compiled.
"""

from .jit import CHUNKS, chunk, kernel, parallel_if_many, prange
from .precision import converted, with_rounded_spacing
from .relaxation import blend, blend_moment, moment, shift_spin
from .state import affine, body_force, full, put_affine
from .stencil import (
    add_to_node,
    arm,
    column,
    columns,
    gradient,
    inverse_inertia,
    locate,
    node,
    of_node,
    product,
    slopes_per_axis,
    weights_per_axis,
)
from .tensor import fill, lin, mat, mlin, mv, outer, put_mat, put_vec, transpose, vec
from .transfer_lines import (
    gather_lines_all,
    gather_lines_mls_all,
    scatter_lines_color,
    scatter_lines_mls_color,
)
from .transfer_mls3 import fits, gather_mls3_all, scatter_mls3_color


@kernel
def scatter(particles, grid, stencil, dt, members):
    """Gradient form, for the particles listed in `members`.

    m_i += sum_p w_ip m_p
    m_i v_i += sum_p w_ip m_p (v_p + C_p r_ip)                                  # NSF-alg-mpm step 1
    f_i += sum_p w_ip m_p b_p - V0_p tau_p dw_ip                         # NSF-eq6, NCLAW-eq10
    """
    d = grid.m.shape
    for p in members:
        base, s = locate(vec(particles.x, p, d), grid, stencil)
        w, dw = weights_per_axis(s, stencil), slopes_per_axis(s, stencil)
        m, v, C = particles.m[p], vec(particles.v, p, d), affine(particles.C, p, d)
        b, tau = body_force(particles.b, p, d), full(particles.tau, p, d)
        for c in range(columns(s, stencil)):
            k = column(c, stencil, d)
            for l in range(len(stencil)):
                i = node(base, k, l)
                w_ip, dw_ip = product(k, l, w), gradient(k, l, w, dw, grid.dx)
                mv_ip = lin(w_ip * m, v, w_ip * m, mv(C, arm(k, l, s, grid.dx)))
                f_ip = lin(w_ip * m, b, -particles.V0[p], mv(tau, dw_ip))
                grid.m[i] += w_ip * m
                add_momentum_and_force(grid.v, grid.f, i, mv_ip, f_ip, dt)


@kernel
def add_momentum_and_force(v, f, i, mv, force, dt):
    """Forces join the momentum at once, unless the grid carries them apart."""
    if f.ndim == 1:
        add_to_node(v, i, lin(1.0, mv, dt, force))
    else:
        add_to_node(v, i, mv)
        add_to_node(f, i, force)


@kernel
def scatter_mls(particles, grid, stencil, dt, members):
    """MLS form: the force is part of the affine momentum, unless the grid carries it separately.

    m_i += sum_p w_ip m_p
    m_i v_i += sum_p w_ip (m_p (v_p + dt b_p) + Q_p r_ip)
    Q_p = m_p C_p - dt V0_p tau_p D^-1                                          # NCLAW-mls
    """
    d = grid.m.shape
    joined = joined_time(grid.f, dt)
    for p in members:
        base, s = locate(vec(particles.x, p, d), grid, stencil)
        w = weights_per_axis(s, stencil)
        m, C, tau = particles.m[p], affine(particles.C, p, d), full(particles.tau, p, d)
        b, D_inv = body_force(particles.b, p, d), inverse_inertia(grid.dx, stencil)
        Q = mlin(m, C, -joined * D_inv * particles.V0[p], tau)
        mv_p = lin(m, vec(particles.v, p, d), m * joined, b)
        for c in range(columns(s, stencil)):
            k = column(c, stencil, d)
            for l in range(len(stencil)):
                i = node(base, k, l)
                w_ip = product(k, l, w)
                r_ip = arm(k, l, s, grid.dx)
                grid.m[i] += w_ip * m
                add_to_node(grid.v, i, lin(w_ip, mv_p, w_ip, mv(Q, r_ip)))
                f_ip = lin(w_ip * m, b, -w_ip * D_inv * particles.V0[p], mv(tau, r_ip))
                add_separate_force(grid.f, i, f_ip)


@kernel
def joined_time(f, dt):
    """dt, or 0 where the grid carries forces separately: the time for which they join momenta."""
    if f.ndim == 1:
        return dt
    else:
        return 0.0


@kernel
def add_separate_force(f, i, force):
    """f_i += force, where the grid carries forces separately."""
    if f.ndim > 1:
        add_to_node(f, i, force)


@kernel
def gather(particles, grid, stencil, dt, flip, bounds):
    """Gradient form, for the particles bounds[0] .. bounds[1] - 1.

    u_p = sum_i w_ip v_i,   x_p += dt u_p,   L_p = sum_i v_i dw_ip^T            # NSF-alg-mpm step 3
    C_p = sum_i w_ip v_i r_ip^T D^-1                       where C is carried (APIC)
    v_p = u_p + flip (v_p - sum_i w_ip v_old_i)            where v_old is carried (FLIP), else u_p
    C_p = C_p + flip (C_p - sum_i w_ip v_old_i r_ip^T D^-1) - `shift_spin`       where both are
    """
    d = grid.m.shape
    D = 1.0 / inverse_inertia(grid.dx, stencil)
    for p in range(bounds[0], bounds[1]):
        x = vec(particles.x, p, d)
        base, s = locate(x, grid, stencil)
        w, dw = weights_per_axis(s, stencil), slopes_per_axis(s, stencil)
        u, lag = fill(0.0, d), vec(particles.v, p, d)
        L, B = outer(u, u), outer(u, u)
        lag_B = moment(particles.C, p, D, d)
        for c in range(columns(s, stencil)):
            k = column(c, stencil, d)
            for l in range(len(stencil)):
                i = node(base, k, l)
                w_ip, v_i, r_ip = product(k, l, w), of_node(grid.v, i), arm(k, l, s, grid.dx)
                u = lin(1.0, u, w_ip, v_i)
                L = mlin(1.0, L, 1.0, outer(v_i, gradient(k, l, w, dw, grid.dx)))
                B = mlin(1.0, B, w_ip, outer(v_i, r_ip))
                lag = minus_old(lag, w_ip, grid.v_old, i)
                lag_B = minus_old_moment(lag_B, w_ip, grid.v_old, i, r_ip)
        put_vec(particles.x, p, lin(1.0, x, dt, u))
        put_mat(particles.L, p, L)
        B = blend_moment(B, flip, lag_B, shift_spin(u, lag, flip, dt), grid.v_old)
        put_affine(particles.C, p, inverse_inertia(grid.dx, stencil), B)
        put_vec(particles.v, p, blend(u, flip, lag, grid.v_old))


@kernel
def minus_old_moment(lag, w_ip, v_old, i, r_ip):
    """lag - w_ip v_old_i r_ip^T, where the old velocity is carried."""
    if v_old.ndim == 1:
        return lag
    else:
        return mlin(1.0, lag, -w_ip, outer(of_node(v_old, i), r_ip))


@kernel
def minus_old(lag, w_ip, v_old, i):
    """lag - w_ip v_old_i, where the old velocity is carried."""
    if v_old.ndim == 1:
        return lag
    else:
        return lin(1.0, lag, -w_ip, of_node(v_old, i))


@kernel
def gather_mls(particles, grid, stencil, dt, flip, bounds):
    """MLS form: u_p = sum_i w_ip v_i, x_p += dt u_p, L_p = C_p = sum_i w_ip v_i r_ip^T D^-1.

    v_p = u_p; where v_old is carried, L is another array and v and C relax as in `gather`.
    """
    d = grid.m.shape
    D_inv = inverse_inertia(grid.dx, stencil)
    for p in range(bounds[0], bounds[1]):
        x = vec(particles.x, p, d)
        base, s = locate(x, grid, stencil)
        w = weights_per_axis(s, stencil)
        u, lag = fill(0.0, d), vec(particles.v, p, d)
        B, lag_B = outer(u, u), moment(particles.C, p, 1.0 / D_inv, d)
        for c in range(columns(s, stencil)):
            k = column(c, stencil, d)
            for l in range(len(stencil)):
                i, w_ip, r_ip = node(base, k, l), product(k, l, w), arm(k, l, s, grid.dx)
                v_i = of_node(grid.v, i)
                u = lin(1.0, u, w_ip, v_i)
                B = mlin(1.0, B, w_ip, outer(v_i, r_ip))
                lag = minus_old(lag, w_ip, grid.v_old, i)
                lag_B = minus_old_moment(lag_B, w_ip, grid.v_old, i, r_ip)
        put_vec(particles.v, p, blend(u, flip, lag, grid.v_old))
        put_vec(particles.x, p, lin(1.0, x, dt, u))
        put_separate_gradient(particles.L, p, D_inv, B, grid.v_old)
        B = blend_moment(B, flip, lag_B, shift_spin(u, lag, flip, dt), grid.v_old)
        put_affine(particles.C, p, D_inv, B)


@kernel
def put_separate_gradient(L, p, D_inv, B, v_old):
    """L_p = D^-1 B, where the old velocity is carried; else L is the array of C."""
    if v_old.ndim > 1:
        put_affine(L, p, D_inv, B)


@kernel
def damp(C, rpic, like, bounds):
    """C <- (1 - rpic) sym C + skew C: damps the strain rate, keeps the rotation (NSF-rpic)."""
    for p in range(bounds[0], bounds[1]):
        A = mat(C, p, like)
        put_mat(C, p, mlin(1.0 - 0.5 * rpic, A, -0.5 * rpic, transpose(A)))


@parallel_if_many
def _damp(C, damping, like):
    for c in prange(CHUNKS):
        damp(C, damping, like, chunk(c, len(C)))


def p2g(particles, grid, stencil, dt, slabs, mls):
    """Add mass and momentum of all particles to a zeroed grid; see `scatter` and `scatter_mls`.

    Slabs of one colour are far enough apart to share no node, so they run in parallel; within a
    slab particles come in a fixed order. Hence the same bits for any number of threads.
    """
    grid, stencil = with_rounded_spacing(grid), converted(stencil, grid.v.dtype.type)
    run = scatter_lines_mls_color if mls else scatter_lines_color
    if fits(grid, stencil, mls):
        run = scatter_mls3_color
    for color in (0, 1):
        run(particles, grid, stencil, dt, slabs, color)


def g2p(particles, grid, stencil, dt, flip, mls):
    """New velocity, position and velocity gradient of all particles; see `gather` and
    `gather_mls`.
    """
    grid, stencil = with_rounded_spacing(grid), converted(stencil, grid.v.dtype.type)
    if fits(grid, stencil, mls):
        gather_mls3_all(particles, grid, stencil, dt)
    elif mls:
        gather_lines_mls_all(particles, grid, stencil, dt, flip)
    else:
        gather_lines_all(particles, grid, stencil, dt, flip)


def rpic(C, damping):
    """`damp` for all particles."""
    _damp(C, converted(damping, C.dtype.type), tuple(range(C.shape[1])))
