"""Adjoint of the transfers: gradients of a loss carried back through g2p and through p2g.

A bar is the gradient of the loss with respect to the field of the same name; bars of particles
stand in a `Particles`, those of nodes in a `Grid`. What the transfer gathers its adjoint scatters,
and the other way round. Names as in `transfer`; a_ip is the `shape_gradient` of a pair.
`scatter_bars` and `gather_bars` are as plain as the sums are; `g2p_adjoint` and `p2g_adjoint` run
in parallel the same sums written for speed, `transfer_lines`, which are tested against them.
"""

from typing import NamedTuple

import numpy as np

from ..jit import kernel
from ..state import NONE, add_body_force, affine, body_force, full, put_full
from ..stencil import (
    add_to_node,
    arm,
    column,
    columns,
    gradient,
    inverse_inertia,
    node,
    of_node,
    product,
)
from ..tensor import (
    dot,
    fill,
    inner,
    lin,
    mat,
    mlin,
    mv,
    outer,
    put_mat,
    put_vec,
    vec,
    vm,
)
from ..transfer_mls3 import fits
from .shape_gradient import (
    GradientForm,
    MlsForm,
    around,
    hessian,
    shape_gradient,
    shape_gradient_bar,
)
from .transfer_lines import (
    Advection,
    Motion,
    OfArms,
    OfSlopes,
    gather_joined_all,
    gather_separate_all,
    gradients_all,
    scatter_bars_color,
    scatter_lag_color,
    velocities_all,
)


class Exchange(NamedTuple):
    """Parameters of the exchange of momentum between particles and grid in one step."""

    stencil: tuple
    dt: float       # [s]
    flip: float     # share of FLIP or of relaxation; used where the grid carries v_old
    mls: bool


@kernel
def scatter_bars(advection, grid, bars, nodes, stencil, members):
    """Adjoint of `gather` and `gather_mls` for the particles in `members`.

    With bars C_p, L_p after the step, bars.v = flip v'_p and U_ip = u_p + D^-1 C_p r_ip:
    v_i += w_ip U_ip + L_p dw_ip,   v_old_i -= w_ip flip v'_p
    x_p += sum_i (v_i . U_ip - v_old_i . flip v'_p) dw_ip - w_ip (D^-1 C_p)^T v_i
                 + (d^2 w_ip/dx_p^2) L_p^T v_i
    With relaxation U_old_ip = flip v'_p + D^-1 lag_affine_p r_ip stands for flip v'_p.
    """
    d = grid.m.shape
    D_inv = inverse_inertia(grid.dx, stencil)
    for p in members:
        base, splines = around(vec(advection.x, p, d), grid, stencil)
        x, u, lag = vec(bars.x, p, d), vec(advection.u, p, d), vec(bars.v, p, d)
        B = affine(bars.C, p, d)
        B = mlin(D_inv, B, 0.0, B)
        for c in range(columns(x, stencil)):
            k = column(c, stencil, d)
            for l in range(len(stencil)):
                i = node(base, k, l)
                w_ip, v_i = product(k, l, splines.w), of_node(grid.v, i)
                U_ip = lin(1.0, u, 1.0, mv(B, arm(k, l, splines.s, grid.dx)))
                add_to_node(nodes.v, i, lin(w_ip, U_ip, 1.0, stretch(bars.L, p, k, l, splines)))
                r_ip, v_old_i = arm(k, l, splines.s, grid.dx), old(grid.v_old, i, d)
                U_old_ip = with_lag(lag, advection.lag_affine, p, D_inv, r_ip)
                add_old(nodes.v_old, i, -w_ip, U_old_ip)
                along = dot(v_i, U_ip) - dot(v_old_i, U_old_ip)
                x = lin(1.0, x, along, gradient(k, l, splines.w, splines.dw, grid.dx))
                turned = stretch_bar(bars.L, p, v_i, k, l, splines)
                x = lin(1.0, x, 1.0, lin(-w_ip, vm(v_i, B), 1.0, turned))
                x = plus_lag_arm(x, advection.lag_affine, p, w_ip * D_inv, v_old_i)
        put_vec(bars.x, p, x)


@kernel
def with_lag(lag, lag_affine, p, D_inv, r_ip):
    """lag + D^-1 lag_affine_p r_ip, where lag_affine is carried (relaxation)."""
    if lag_affine.ndim == 3:
        return lin(1.0, lag, D_inv, mv(mat(lag_affine, p, lag), r_ip))
    else:
        return lag


@kernel
def plus_lag_arm(x, lag_affine, p, scale, v_old_i):
    """x + scale lag_affine_p^T v_old_i, where lag_affine is carried: r_ip moves against x_p."""
    if lag_affine.ndim == 3:
        return lin(1.0, x, scale, vm(v_old_i, mat(lag_affine, p, x)))
    else:
        return x


def add_spin_bars(particles, grid, bars, of_u, how):
    """Adjoint of `shift_spin`: with A = D^-1 (C_p - C_p^T) of the bars C_p,

    u_p += flip dt/2 A lag_p,    v_p -= flip dt/2 A u_p        (u_p in `of_u`, v_p in `bars`)
    """
    u, lag = np.empty_like(of_u), np.empty_like(of_u)
    velocities_all(particles, grid, how.stencil, u, lag)
    scale = 0.5 * how.flip * how.dt * inverse_inertia(grid.dx, how.stencil)
    A = scale * (bars.C - np.swapaxes(bars.C, 1, 2))
    of_u += np.einsum("pab,pb->pa", A, lag)
    bars.v[:] -= np.einsum("pab,pb->pa", A, u)


@kernel
def stretch(L, p, k, l, splines):
    """L_p dw_ip, or zero where L is C (MLS)."""
    if L.ndim == 3:
        return mv(mat(L, p, splines.s), gradient(k, l, splines.w, splines.dw, splines.dx))
    else:
        return fill(0.0, splines.s)


@kernel
def stretch_bar(L, p, v_i, k, l, splines):
    """(d^2 w_ip/dx_p^2) L_p^T v_i, or zero where L is C (MLS)."""
    if L.ndim == 3:
        return mv(hessian(k, l, splines), vm(v_i, mat(L, p, v_i)))
    else:
        return fill(0.0, v_i)


@kernel
def old(v_old, i, like):
    """v_old_i, or zero where it is not carried."""
    if v_old.ndim == 1:
        return fill(0.0, like)
    else:
        return of_node(v_old, i)


@kernel
def add_old(v_old, i, w, v):
    """v_old_i += w v, where it is carried."""
    if v_old.ndim > 1:
        add_to_node(v_old, i, lin(w, v, 0.0, v))


@kernel
def gather_bars(particles, nodes, bars, stencil, form, bounds):
    """Adjoint of `scatter` and `scatter_mls` for the particles bounds[0] .. bounds[1] - 1.

    With phi_ip = m_i + v_i . (v_p + C_p r_ip) + f_i . b_p, where m_i, v_i, f_i are bars of nodes:
    x_p += sum_i m_p phi_ip dw_ip - m_p w_ip C_p^T v_i - V0_p (da_ip/dx_p)^T tau_p^T f_i
    v_p += sum_i w_ip m_p v_i,   m_p += sum_i w_ip phi_ip,   V0_p -= tau_p : sum_i f_i a_ip^T
    b_p += sum_i w_ip m_p f_i    (added to)
    C_p = sum_i w_ip m_p v_i r_ip^T,   tau_p = -V0_p sum_i f_i a_ip^T       (overwritten; with
    relaxation C_p is added to)
    """
    d = nodes.m.shape
    for p in range(bounds[0], bounds[1]):
        base, splines = around(vec(particles.x, p, d), nodes, stencil)
        m, V0, x = particles.m[p], particles.V0[p], vec(bars.x, p, d)
        v, C = vec(particles.v, p, d), affine(particles.C, p, d)
        b, tau = body_force(particles.b, p, d), full(particles.tau, p, d)
        mass, mv_p, f_p = 0.0, fill(0.0, d), fill(0.0, d)
        B, T = outer(f_p, f_p), outer(f_p, f_p)
        for c in range(columns(x, stencil)):
            k = column(c, stencil, d)
            for l in range(len(stencil)):
                i = node(base, k, l)
                w_ip, r_ip = product(k, l, splines.w), arm(k, l, splines.s, nodes.dx)
                v_i = of_node(nodes.v, i)
                f_i = force_bar(nodes.f, i, v_i, form.dt)
                phi = nodes.m[i] + dot(v_i, lin(1.0, v, 1.0, mv(C, r_ip))) + dot(f_i, b)
                mass += w_ip * phi
                mv_p, f_p = lin(1.0, mv_p, w_ip, v_i), lin(1.0, f_p, w_ip, f_i)
                B = mlin(1.0, B, w_ip, outer(v_i, r_ip))
                T = mlin(1.0, T, 1.0, outer(f_i, shape_gradient(k, l, splines, form)))
                x = lin(1.0, x, m * phi, gradient(k, l, splines.w, splines.dw, nodes.dx))
                x = lin(1.0, x, -V0, shape_gradient_bar(k, l, splines, vm(f_i, tau), form))
        put_vec(bars.x, p, lin(1.0, x, -m, vm(mv_p, C)))
        put_vec(bars.v, p, lin(1.0, vec(bars.v, p, d), m, mv_p))
        put_affine_bar(bars.C, p, m, B, nodes.v_old)
        put_full(bars.tau, p, mlin(-V0, T, 0.0, T))
        add_body_force(bars.b, p, m, f_p)
        bars.m[p] += mass
        bars.V0[p] -= inner(tau, T)


@kernel
def put_affine_bar(C, p, m, B, v_old):
    """C_p = m B, where an affine field is carried; added to, where the old velocity is as well."""
    if C.ndim == 3:
        if v_old.ndim == 1:
            put_mat(C, p, mlin(m, B, 0.0, B))
        else:
            put_mat(C, p, mlin(m, B, 1.0, mat(C, p, v_old.shape[:-1])))


@kernel
def force_bar(f, i, v_i, dt):
    """Bar of the force: dt times that of the momentum, unless the grid carries forces apart."""
    if f.ndim == 1:
        return lin(dt, v_i, 0.0, v_i)
    else:
        return of_node(f, i)


def velocity_gradients(x, grid, L, how):
    """Compute L (N, d, d) of g2p for particles at x (N, d), to the bit, from a grid of records."""
    if not how.mls:
        form = OfSlopes(1.0, 1.0 / grid.dx)
    else:
        D_inv = inverse_inertia(grid.dx, how.stencil)
        at_once = grid.v_old.ndim > 1 or fits(grid, how.stencil, how.mls)
        form = OfArms(1.0, grid.dx * D_inv) if at_once else OfArms(grid.dx, D_inv)
    gradients_all(x, grid, L, how.stencil, form)


def g2p_adjoint(particles, grid, bars, nodes, how, slabs):
    """Adjoint of `g2p` of particles, of which x (N, d) and with relaxation v are read: bars of x,
    v, C, L after it add to those of nodes (v, v_old) and become those of x, v and with relaxation
    C before it.

    grid and nodes are grids of records (see `records`). Slabs of one colour run in parallel (see
    `p2g`). Under MLS without relaxation the bar of C is that of L too, and bars.L is not read.
    """
    remembers = grid.v_old.ndim > 1
    relaxed = remembers and bars.C.ndim == 3
    of_grid = bars._replace(L=NONE) if how.mls else bars
    if relaxed:
        motion = relaxation_bars(particles, grid, bars, how)
        of_grid = of_grid._replace(C=bars.C + bars.L) if how.mls else of_grid
    else:
        motion = Motion(particles.x, NONE, how.dt, how.flip if remembers else 0.0)
    for run in (scatter_bars_color, scatter_lag_color)[: 2 if remembers else 1]:
        for color in (0, 1):
            of_color = slabs._replace(start=slabs.start[color:])
            run(motion, grid, of_grid, nodes, how.stencil, of_color)
    if relaxed:
        bars.C[:] = motion.lag_affine


def relaxation_bars(particles, grid, bars, how):
    """Return the `Advection` of particles whose C relaxes; bars of v become those of their lag."""
    motion = Advection(particles.x, bars.v + how.dt * bars.x, how.flip * bars.C)
    bars.v[:] *= how.flip
    add_spin_bars(particles, grid, bars, motion.u, how)
    return motion


def p2g_adjoint(particles, nodes, bars, how):
    """Adjoint of `p2g`: from the bars `nodes` of m, v, f, as a grid of records, to those of
    particles; those of x, v, b, m, V0 and with relaxation C are added to, those of tau and else of
    C overwritten.
    """
    form = GradientForm(how.dt)
    if how.mls:
        form = MlsForm(how.dt, inverse_inertia(nodes.dx, how.stencil))
    run = gather_joined_all if nodes.f.ndim == 1 else gather_separate_all
    run(particles, nodes, bars, how.stencil, form)
