"""The adjoint of the transfer of NCLaw, MLS form, quadratic splines, 3D, on plain grids.

A batch of bodies has one small grid for each (see `nclaw.batched_step`). The sums are those of
`scatter_bars` and `gather_bars` of `adjoint.transfer`, line by line as in `transfer_mls3`. Both
have in common a field U_ip = U_p + Q_p r_ip, affine in the node's position, of which sum_i w_ip
h_ip with h_ip = v_i . U_ip is differentiated:

    x_p += sum_i h_ip dw_ip - Q_p^T sum_i w_ip v_i

Where the field is scattered as well, it is formed at the three nodes of a line along the last axis,
and h with it; otherwise the sums are moments of v.
"""

from ..jit import kernel
from ..lines import _1, _2, _3, node_number, strides
from ..state import add_body_force, affine, body_force, full, put_affine, put_full
from ..stencil import inverse_inertia, locate, slopes_per_axis, weights_per_axis
from ..tensor import dot, fill, inner, lin, mlin, mv, outer, put_vec, transpose, vec, vm
from ..transfer_mls3 import add_momenta, line_of, moments, weighted


@kernel
def scatter_bars_mls3(advection, grid, bars, nodes, stencil, members):
    """`scatter_bars` for MLS-MPM with a quadratic stencil in 3D."""
    v, v_bar, n = grid.v.reshape(-1), nodes.v.reshape(-1), strides(grid.m)
    for p in members:
        base, s = locate(vec(advection.x, p, grid.m.shape), grid, stencil)
        w, dw = weights_per_axis(s, stencil), slopes_per_axis(s, stencil)
        u, B = vec(advection.u, p, s), affine(bars.C, p, s)
        Q = mlin(grid.dx * inverse_inertia(grid.dx, stencil), B, 0.0, B)
        first, dx_U, dy_U = field(u, Q, s)
        slope, mean = fill(0.0, s), fill(0.0, s)
        i = node_number(base, n)
        for a in range(3):
            U, j = first, i
            for b in range(3):
                line, w_ab = line_of(v, _3 * j), w[0][a] * w[1][b]
                add_momenta(v_bar, _3 * j, w_ab, rows_times(w[2], U))
                slope = with_line(slope, along(line, U), (w, dw), a, b)
                mean = lin(1.0, mean, w_ab, vm(w[2], line))
                U, j = mlin(1.0, U, 1.0, dy_U), j + n[1]
            first, i = mlin(1.0, first, 1.0, dx_U), i + n[0]
        x = lin(1.0, vec(bars.x, p, s), 1.0 / grid.dx, lin(1.0, slope, -1.0, vm(mean, Q)))
        put_vec(bars.x, p, x)


@kernel
def gather_bars_mls3(particles, nodes, bars, stencil, dt, bounds):
    """`gather_bars` for MLS-MPM with a quadratic stencil in 3D."""
    n, stiff = strides(nodes.m), dt * inverse_inertia(nodes.dx, stencil)
    for p in range(bounds[0], bounds[1]):
        base, s = locate(vec(particles.x, p, nodes.m.shape), nodes, stencil)
        x, y, z = factors(s, stencil)
        mass, V0, C = particles.m[p], particles.V0[p], affine(particles.C, p, s)
        tau, b = full(particles.tau, p, s), body_force(particles.b, p, s)
        u = lin(1.0, vec(particles.v, p, s), dt, b)
        Q = mlin(mass * nodes.dx, C, -stiff * V0 * nodes.dx, tau)
        i = node_number(base, n)
        v_p, B, slope_of_v, slope_of_r = moments_of_v(nodes.v.reshape(-1), i, n, (x, y, z))
        m_p, slope = moments_of_m(nodes.m.reshape(-1), i, n, (x, y, z))
        slope = lin(mass, lin(1.0, slope, 1.0, mv(slope_of_v, u)), 1.0, contracted(slope_of_r, Q))
        x_bar = lin(1.0, slope, -1.0, vm(v_p, Q))
        put_vec(bars.x, p, lin(1.0, vec(bars.x, p, s), 1.0 / nodes.dx, x_bar))
        put_vec(bars.v, p, lin(1.0, vec(bars.v, p, s), mass, v_p))
        put_affine(bars.C, p, mass * nodes.dx, B)
        put_full(bars.tau, p, mlin(-V0 * stiff * nodes.dx, B, 0.0, B))
        add_body_force(bars.b, p, mass * dt, v_p)
        bars.m[p] += m_p + dot(u, v_p) + nodes.dx * inner(C, B)
        bars.V0[p] -= stiff * nodes.dx * inner(tau, B)


# Sums over the 27 nodes from number i on, with factors w, dw, w r, dw r of each axis (lengths in
# cells). As h_ip = v_i . (U_p + Q_p r_ip), all sums of h_ip dw_ip are moments of v, which are
# summed up axis by axis, the last one last: nearly all work is on lines of nine numbers.

@kernel
def factors(s, stencil):
    """(w, dw, w r, dw r) of each axis."""
    w, dw = weights_per_axis(s, stencil), slopes_per_axis(s, stencil)
    return (factors_of_axis(w[0], dw[0], s[0]), factors_of_axis(w[1], dw[1], s[1]),
            factors_of_axis(w[2], dw[2], s[2]))


@kernel
def factors_of_axis(w, dw, s):
    """(w, dw, w r, dw r) of one axis."""
    return w, dw, moments(w, s), moments(dw, s)


@kernel
def moments_of_v(v, i, n, axes):
    """sum_i w_ip v_i; the matrix sum_i w_ip v_i r_ip^T; a row sum_i v_i dw_ip/dx_a for each axis a;
    and for each a the rows sum_i r_ip,b v_i dw_ip/dx_a of b.
    """
    x, y, z = axes
    A, B, C = plane_moments(v, i, n[1], y), plane_moments(v, i + n[0], n[1], y), plane_moments(
        v, i + n[0] + n[0], n[1], y)
    ww, dw = weighted(x[0], A[0], B[0], C[0]), weighted(x[1], A[0], B[0], C[0])
    rw, sw = weighted(x[2], A[0], B[0], C[0]), weighted(x[3], A[0], B[0], C[0])
    wd, rd = weighted(x[0], A[1], B[1], C[1]), weighted(x[2], A[1], B[1], C[1])
    wr, dr = weighted(x[0], A[2], B[2], C[2]), weighted(x[1], A[2], B[2], C[2])
    ws = weighted(x[0], A[3], B[3], C[3])
    moment = transpose((vm(z[0], rw), vm(z[0], wr), vm(z[2], ww)))
    slope = vm(z[0], dw), vm(z[0], wd), vm(z[1], ww)
    slope_of_r = ((vm(z[0], sw), vm(z[0], dr), vm(z[2], dw)),
                  (vm(z[0], rd), vm(z[0], ws), vm(z[2], wd)),
                  (vm(z[1], rw), vm(z[1], wr), vm(z[3], ww)))
    return vm(z[0], ww), moment, slope, slope_of_r


@kernel
def plane_moments(v, i, n, y):
    """Sums of the three lines from node i on, n nodes apart, with each factor of the axis y."""
    a, b, c = line_of(v, _3 * i), line_of(v, _3 * (i + n)), line_of(v, _3 * (i + n + n))
    return weighted(y[0], a, b, c), weighted(y[1], a, b, c), weighted(y[2], a, b, c), weighted(
        y[3], a, b, c)


@kernel
def moments_of_m(m, i, n, axes):
    """sum_i w_ip m_i, and sum_i m_i dw_ip/dx_a of each axis a."""
    x, y, z = axes
    a, b, c = plane_of_m(m, i, n[1], y), plane_of_m(m, i + n[0], n[1], y), plane_of_m(
        m, i + n[0] + n[0], n[1], y)
    ww = combined(x[0], a[0], b[0], c[0])
    slope = (dot(z[0], combined(x[1], a[0], b[0], c[0])),
             dot(z[0], combined(x[0], a[1], b[1], c[1])), dot(z[1], ww))
    return dot(z[0], ww), slope


@kernel
def plane_of_m(m, i, n, y):
    """Sums of three lines of masses from node i on, n nodes apart, with w and dw of the axis y."""
    a, b, c = masses(m, i), masses(m, i + n), masses(m, i + n + n)
    return combined(y[0], a, b, c), combined(y[1], a, b, c)


@kernel
def masses(m, i):
    """The three numbers from i on."""
    return m[i], m[i + _1], m[i + _2]


@kernel
def combined(w, a, b, c):
    """w_0 a + w_1 b + w_2 c of vectors."""
    return lin(1.0, lin(w[0], a, w[1], b), w[2], c)


@kernel
def contracted(slope_of_r, Q):
    """sum_b (Q e_b) . slope_of_r[a][b] for each a."""
    columns = transpose(Q)
    return (inner(slope_of_r[0], columns), inner(slope_of_r[1], columns),
            inner(slope_of_r[2], columns))


@kernel
def field(u, Q, s):
    """U at the first line's nodes, and its growth from line to line along the first two axes; Q is
    its growth from node to node.
    """
    x, y, z = transpose(Q)
    at_base, ones = lin(1.0, u, -1.0, mv(Q, s)), fill(1.0, s)
    line = mlin(1.0, outer(ones, at_base), 1.0, outer((0.0, 1.0, 2.0), z))
    return line, outer(ones, x), outer(ones, y)


@kernel
def along(line, U):
    """v_i . U_ip of the nodes of a line."""
    return dot(line[0], U[0]), dot(line[1], U[1]), dot(line[2], U[2])


@kernel
def rows_times(w, A):
    """The rows of A, each with its weight."""
    a, b, c = A
    return lin(w[0], a, 0.0, a), lin(w[1], b, 0.0, b), lin(w[2], c, 0.0, c)


@kernel
def with_line(slope, h, splines, a, b):
    """slope + sum of h_i dw_ip dx over the nodes of line (a, b)."""
    w, dw = splines
    H = dot(w[2], h)
    return (slope[0] + dw[0][a] * w[1][b] * H, slope[1] + w[0][a] * dw[1][b] * H,
            slope[2] + w[0][a] * w[1][b] * dot(dw[2], h))
