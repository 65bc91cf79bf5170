"""The adjoints of the transfers, written for speed, for all forms and splines.

The same sums as `scatter_bars` and `gather_bars` of `adjoint.transfer`, by lines of `records`. A
particle brings to the nodes, or takes from their bars, a field

    w_ip (U + Q r_ip) + dx S dw_ip

whose columns Q and S are absent, (), where the transfer has none. What a field brings is spread as
in `transfer_lines`; what is taken follows from few sums over the nodes (see `moments`).
"""

from typing import NamedTuple

import numpy as np

from ..jit import CHUNKS, by_type, chunk, kernel, leaf, parallel_if_many, prange
from ..lines import arms_per_axis, by_plane, plus, times
from ..state import add_body_force, body_force, full, put_affine, put_full
from ..stencil import inverse_inertia
from ..tensor import dot, inner, lin, mat, mlin, put_mat, put_vec, scale, vec
from .moments import MEAN, SUMS, first_sums, put_sums
from .records import (
    WIDTH,
    column_records,
    gradient_columns,
    last_in,
    lines_around,
    matrix_of,
    record,
    record_of,
    spread,
    vector_in,
)
from .shape_gradient import GradientForm, MlsForm
from .slopes import arms_around, moment_columns, slope_columns, slopes


@leaf
def columns_of(a, p, factor, like):
    """The columns of a matrix of a field (N, d, d), times a factor; () where it is not carried."""
    if a.ndim == 3:
        return column_records(scale(factor, mat(a, p, like)))
    else:
        return ()


# g2p

class Advection(NamedTuple):
    """Positions of particles before g2p, the bars of sum_i w_ip v_i, and those of C_p - sum_i w_ip
    v_old_i r_ip^T D^-1 where C relaxes, else (0,); bars of v are those of v_p - sum_i w_ip v_old_i.
    """

    x: np.ndarray            # (N, d)
    u: np.ndarray            # (N, d)
    lag_affine: np.ndarray   # (N, d, d)


class Motion(NamedTuple):
    """Positions of particles before g2p, the step, and the share of their velocity that they keep:
    what makes an `Advection` of bars where no C relaxes. Bars of v are those after g2p.
    """

    x: np.ndarray            # (N, d)
    lag_affine: np.ndarray   # (0,)
    dt: float                # [s]
    flip: float


mean_bar = by_type("mean_bar")      # (bars, p, like, motion) -> bar of u_p; bars.v is the lag's


@leaf
def _of_advection(bars, p, like, motion):
    return vec(motion.u, p, like)


@leaf
def _of_motion(bars, p, like, motion):
    v = vec(bars.v, p, like)
    put_vec(bars.v, p, times(motion.flip, v))
    return lin(1.0, v, motion.dt, vec(bars.x, p, like))


mean_bar.method(Advection, _of_advection)
mean_bar.method(Motion, _of_motion)


@kernel
def scatter_bars_lines(motion, grid, bars, nodes, stencil, members):
    """`transfer.scatter_bars` of an `Advection` or a `Motion`, but for the old velocity."""
    M, X, dx = np.empty(WIDTH * SUMS), np.empty(WIDTH * 3), grid.dx
    v, v_bar, turn = grid.v.reshape(-1), nodes.v.reshape(-1), dx * inverse_inertia(dx, stencil)
    for p in members:
        lines, (w, dw, s) = lines_around(vec(motion.x, p, grid.m.shape), grid, stencil)
        u = record_of(mean_bar(bars, p, s, motion), 0.0)
        field = u, columns_of(bars.C, p, turn, s), columns_of(bars.L, p, 1.0 / dx, s)
        spread(v_bar, field, s, lines)
        put_sums(M, v, field, lines, (s, stencil))
        x = slopes(X, M, field, arms_around(w, dw, s), stencil)
        put_vec(bars.x, p, lin(1.0, vec(bars.x, p, s), 1.0 / dx, x))


@kernel
def scatter_lag_bars(motion, grid, bars, nodes, stencil, members):
    """The part of `transfer.scatter_bars` with the old velocity, after `scatter_bars_lines`."""
    M, X, dx = np.empty(WIDTH * SUMS), np.empty(WIDTH * 3), grid.dx
    v, v_bar, turn = grid.v_old.reshape(-1), nodes.v_old.reshape(-1), inverse_inertia(dx, stencil)
    for p in members:
        lines, (w, dw, s) = lines_around(vec(motion.x, p, grid.m.shape), grid, stencil)
        lag = record_of(times(-1.0, vec(bars.v, p, s)), 0.0)
        field = lag, columns_of(motion.lag_affine, p, -dx * turn, s), ()
        spread(v_bar, field, s, lines)
        put_sums(M, v, field, lines, (s, stencil))
        x = slopes(X, M, field, arms_around(w, dw, s), stencil)
        put_vec(bars.x, p, lin(1.0, vec(bars.x, p, s), 1.0 / dx, x))


# p2g

stress_columns = by_type("stress_columns")      # (T, dx, form) -> Q, S of the force T a_ip
stress_moment = by_type("stress_moment")        # (D, B, dx, form) -> sum_i f_i a_ip^T


@leaf
def _sloping(T, dx, form):
    return (), column_records(scale(1.0 / dx, T))


@leaf
def _turning(T, dx, form):
    return column_records(scale(form.D_inv * dx, T)), ()


@leaf
def _of_slopes(D, B, dx, form):
    return scale(1.0 / dx, D)


@leaf
def _of_arms(D, B, dx, form):
    return scale(form.D_inv * dx, B)


stress_columns.method(GradientForm, _sloping)
stress_columns.method(MlsForm, _turning)
stress_moment.method(GradientForm, _of_slopes)
stress_moment.method(MlsForm, _of_arms)


@leaf
def joined(A, B):
    """A + B of columns, each maybe ()."""
    if len(A) == 0:
        return B
    elif len(B) == 0:
        return A
    else:
        return plus(A, 1.0, B)


@kernel
def gather_joined(particles, nodes, bars, stencil, form, bounds):
    """`transfer.gather_bars` where forces join the momenta at once."""
    M, X, dx, v = np.empty(WIDTH * SUMS), np.empty(WIDTH * 3), nodes.dx, nodes.v.reshape(-1)
    for p in range(bounds[0], bounds[1]):
        lines, (w, dw, s) = lines_around(vec(particles.x, p, nodes.m.shape), nodes, stencil)
        m, tau, arms = particles.m[p], full(particles.tau, p, s), arms_around(w, dw, s)
        u = lin(1.0, vec(particles.v, p, s), form.dt, body_force(particles.b, p, s))
        Q, S = stress_columns(scale(-form.dt * particles.V0[p], tau), dx, form)
        field = record_of(times(m, u), m), joined(columns_of(particles.C, p, m * dx, s), Q), S
        put_sums(M, v, field, lines, (s, stencil))
        x = slopes(X, M, field, arms, stencil)
        put_vec(bars.x, p, lin(1.0, vec(bars.x, p, s), 1.0 / dx, x))
        put_affine(bars.C, p, m, add_momentum_bars(particles.C, bars, p, (M, arms, m, u), dx))
        add_force_bars(particles, bars, p, (M, arms, tau, form.dt), dx, form)


@kernel
def gather_momenta(particles, nodes, bars, stencil, bounds):
    """The part of `transfer.gather_bars` with masses and momenta, where forces are apart."""
    M, X, dx, v = np.empty(WIDTH * SUMS), np.empty(WIDTH * 3), nodes.dx, nodes.v.reshape(-1)
    for p in range(bounds[0], bounds[1]):
        lines, (w, dw, s) = lines_around(vec(particles.x, p, nodes.m.shape), nodes, stencil)
        m, arms, v_p = particles.m[p], arms_around(w, dw, s), vec(particles.v, p, s)
        field = record_of(times(m, v_p), m), columns_of(particles.C, p, m * dx, s), ()
        put_sums(M, v, field, lines, (s, stencil))
        x = slopes(X, M, field, arms, stencil)
        put_vec(bars.x, p, lin(1.0, vec(bars.x, p, s), 1.0 / dx, x))
        B = add_momentum_bars(particles.C, bars, p, (M, arms, m, v_p), dx)
        add_affine(bars.C, p, m, B)


@kernel
def gather_forces(particles, nodes, bars, stencil, form, bounds):
    """The part of `transfer.gather_bars` with forces that are apart."""
    M, X, dx, f = np.empty(WIDTH * SUMS), np.empty(WIDTH * 3), nodes.dx, nodes.f.reshape(-1)
    for p in range(bounds[0], bounds[1]):
        lines, (w, dw, s) = lines_around(vec(particles.x, p, nodes.m.shape), nodes, stencil)
        tau, arms, m = full(particles.tau, p, s), arms_around(w, dw, s), particles.m[p]
        b = body_force(particles.b, p, s)
        Q, S = stress_columns(scale(-particles.V0[p], tau), dx, form)
        field = record_of(times(m, b), 0.0), Q, S
        put_sums(M, f, field, lines, (s, stencil))
        x = slopes(X, M, field, arms, stencil)
        put_vec(bars.x, p, lin(1.0, vec(bars.x, p, s), 1.0 / dx, x))
        bars.m[p] += dot(b, vector_in(record(M, MEAN), s))
        add_force_bars(particles, bars, p, (M, arms, tau, 1.0), dx, form)


@leaf
def add_momentum_bars(C, bars, p, sums, dx):
    """Add to the bars of v and m, and return sum_i w_ip v_i r_ip^T; sums = (M, arms, m, u) of
    w_ip (m_i + v_i . (u + C_p r_ip)).
    """
    M, arms, m, u = sums
    mean = record(M, MEAN)
    mv_p, B = vector_in(mean, u), scale(dx, matrix_of(moment_columns(M, arms, u), u))
    put_vec(bars.v, p, lin(1.0, vec(bars.v, p, u), m, mv_p))
    bars.m[p] += last_in(mean, u) + dot(u, mv_p)
    add_to_mass(bars.m, p, C, B)
    return B


@leaf
def add_to_mass(m, p, C, B):
    """m_p += C_p : B, where an affine field is carried."""
    if C.ndim == 3:
        m[p] += inner(mat(C, p, B), B)


@leaf
def add_affine(C, p, scale, B):
    """C_p += scale B, where an affine field is carried."""
    if C.ndim == 3:
        put_mat(C, p, mlin(scale, B, 1.0, mat(C, p, B)))


@leaf
def add_force_bars(particles, bars, p, sums, dx, form):
    """Add to the bars of V0 and b, and put that of tau; sums = (M, arms, tau, time) of the impulse
    in a time.
    """
    M, arms, tau, time = sums
    D, B = matrix_of(slope_columns(M, tau), tau), matrix_of(moment_columns(M, arms, tau), tau)
    G, V0 = stress_moment(D, B, dx, form), particles.V0[p]
    put_full(bars.tau, p, mlin(-V0 * time, G, 0.0, G))
    bars.V0[p] -= time * inner(tau, G)
    add_body_force(bars.b, p, particles.m[p] * time, vector_in(record(M, MEAN), tau))


# the velocity gradient of a step, with the bits of `core.transfer`

class OfSlopes(NamedTuple):
    """L_p = sum_i v_i dw_ip^T: its sums with slopes in cells, times two scales in turn."""

    first: float
    second: float


class OfArms(NamedTuple):
    """L_p = D^-1 sum_i w_ip v_i r_ip^T: its sums with arms in cells, times two scales in turn."""

    first: float
    second: float


gradient_factors = by_type("gradient_factors")      # (w, dw, s, form) -> factors of an L by axis


@leaf
def _slopes(w, dw, s, form):
    return dw


@leaf
def _arms(w, dw, s, form):
    return arms_per_axis(w, s)


gradient_factors.method(OfSlopes, _slopes)
gradient_factors.method(OfArms, _arms)


@kernel
def gradients(x, grid, L, stencil, form, bounds):
    """The velocity gradients of particles at x (N, d), of a form `OfSlopes` or `OfArms`."""
    v = grid.v.reshape(-1)
    for p in range(bounds[0], bounds[1]):
        lines, (w, dw, s) = lines_around(vec(x, p, grid.m.shape), grid, stencil)
        g = by_plane(gradient_factors(w, dw, s, form), 0.0)
        sums = matrix_of(gradient_columns(v, g, lines, s), s)
        put_mat(L, p, scale(form.second, scale(form.first, sums)))


# the mean velocities of a step

@kernel
def velocities(particles, grid, stencil, u, lag, bounds):
    """u_p = sum_i w_ip v_i and lag_p = v_p - sum_i w_ip v_old_i, for the particles bounds[0] ..
    bounds[1] - 1.
    """
    v, v_old = grid.v.reshape(-1), grid.v_old.reshape(-1)
    for p in range(bounds[0], bounds[1]):
        lines, (_, _, s) = lines_around(vec(particles.x, p, grid.m.shape), grid, stencil)
        mean, _ = first_sums(v, lines, lines.dw, s)
        mean_old, _ = first_sums(v_old, lines, lines.dw, s)
        put_vec(u, p, vector_in(mean, s))
        put_vec(lag, p, lin(1.0, vec(particles.v, p, s), -1.0, vector_in(mean_old, s)))


# all particles

@parallel_if_many
def scatter_bars_color(motion, grid, bars, nodes, stencil, slabs):
    """`scatter_bars_lines` for every other slab from the first one on, in parallel."""
    for h in prange(len(slabs.start) // 2):
        members = slabs.order[slabs.start[2 * h] : slabs.start[2 * h + 1]]
        scatter_bars_lines(motion, grid, bars, nodes, stencil, members)


@parallel_if_many
def scatter_lag_color(motion, grid, bars, nodes, stencil, slabs):
    """`scatter_lag_bars` for every other slab from the first one on, in parallel."""
    for h in prange(len(slabs.start) // 2):
        members = slabs.order[slabs.start[2 * h] : slabs.start[2 * h + 1]]
        scatter_lag_bars(motion, grid, bars, nodes, stencil, members)


@parallel_if_many
def gather_joined_all(particles, nodes, bars, stencil, form):
    """`gather_joined` for all particles, in parallel."""
    for c in prange(CHUNKS):
        gather_joined(particles, nodes, bars, stencil, form, chunk(c, len(particles.x)))


@parallel_if_many
def gather_separate_all(particles, nodes, bars, stencil, form):
    """`gather_momenta` and `gather_forces` for all particles, in parallel."""
    for c in prange(CHUNKS):
        bounds = chunk(c, len(particles.x))
        gather_momenta(particles, nodes, bars, stencil, bounds)
        gather_forces(particles, nodes, bars, stencil, form, bounds)


@parallel_if_many
def gradients_all(x, grid, L, stencil, form):
    """`gradients` of all particles, in parallel."""
    for c in prange(CHUNKS):
        gradients(x, grid, L, stencil, form, chunk(c, len(x)))


@parallel_if_many
def velocities_all(particles, grid, stencil, u, lag):
    """`velocities` of all particles, in parallel."""
    for c in prange(CHUNKS):
        velocities(particles, grid, stencil, u, lag, chunk(c, len(particles.x)))
