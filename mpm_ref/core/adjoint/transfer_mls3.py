"""The adjoint of the transfer of NCLaw, MLS form, quadratic splines, 3D, on plain grids.

A batch of bodies has one small grid for each (see `nclaw.batched_step`). The sums are those of
`scatter_bars` and `gather_bars` of `adjoint.transfer`, line by line as in `transfer_mls3`. Both
have in common a field U_ip = U_p + Q_p r_ip, affine in the node's position, of which sum_i w_ip
h_ip with h_ip = v_i . U_ip is differentiated:

    x_p += sum_i h_ip dw_ip - Q_p^T sum_i w_ip v_i

At the nodes of a line, three along the last axis, h is three numbers, and all else is their sums
with w and dw along it.
"""

from ..jit import kernel
from ..lines import _1, _2, _3, node_number, strides
from ..state import add_body_force, affine, body_force, full, put_affine, put_full
from ..stencil import inverse_inertia, locate, slopes_per_axis, weights_per_axis
from ..tensor import dot, fill, inner, lin, mlin, mv, outer, put_vec, transpose, vec, vm
from ..transfer_mls3 import add_momenta, line_of, moments


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
        splines = weights_per_axis(s, stencil), slopes_per_axis(s, stencil)
        mass, V0, C = particles.m[p], particles.V0[p], affine(particles.C, p, s)
        tau, b = full(particles.tau, p, s), body_force(particles.b, p, s)
        u = lin(1.0, vec(particles.v, p, s), dt, b)
        Q = mlin(mass * nodes.dx, C, -stiff * V0 * nodes.dx, tau)
        of_field = field(lin(mass, u, 0.0, u), Q, s)
        slope, m_i, mv_p, B = sums(nodes, node_number(base, n), of_field, mass, (splines, s))
        x = lin(1.0, slope, -1.0, vm(mv_p, Q))
        put_vec(bars.x, p, lin(1.0, vec(bars.x, p, s), 1.0 / nodes.dx, x))
        put_vec(bars.v, p, lin(1.0, vec(bars.v, p, s), mass, mv_p))
        put_affine(bars.C, p, mass * nodes.dx, B)
        put_full(bars.tau, p, mlin(-V0 * stiff * nodes.dx, B, 0.0, B))
        add_body_force(bars.b, p, mass * dt, mv_p)
        bars.m[p] += m_i + dot(u, mv_p) + nodes.dx * inner(C, B)
        bars.V0[p] -= stiff * nodes.dx * inner(tau, B)


@kernel
def sums(nodes, i, of_field, mass, location):
    """dx sum_i (v_i . U_ip + m m_i) dw_ip, sum_i w_ip m_i, sum_i w_ip v_i, sum_i w_ip v_i r_ip^T/dx
    of the 27 nodes from number i on, with the field U and location = (splines, s).
    """
    m, v, n = nodes.m.reshape(-1), nodes.v.reshape(-1), strides(nodes.m)
    (splines, s), (first, dx_U, dy_U) = location, of_field
    w, r = splines[0], moments(splines[0][2], s[2])
    slope, m_i = fill(0.0, s), 0.0
    mv_x, mv_y, mv_z, mv_p = slope, slope, slope, slope
    for a in range(3):
        U, j = first, i
        for b in range(3):
            line, masses = line_of(v, _3 * j), (m[j], m[j + _1], m[j + _2])
            slope = with_line(slope, lin(1.0, along(line, U), mass, masses), splines, a, b)
            v_ab, w_ab = vm(w[2], line), w[0][a] * w[1][b]
            m_i += w_ab * dot(w[2], masses)
            mv_p = lin(1.0, mv_p, w_ab, v_ab)
            mv_x = lin(1.0, mv_x, w_ab * (a - s[0]), v_ab)
            mv_y = lin(1.0, mv_y, w_ab * (b - s[1]), v_ab)
            mv_z = lin(1.0, mv_z, w_ab, vm(r, line))
            U, j = mlin(1.0, U, 1.0, dy_U), j + n[1]
        first, i = mlin(1.0, first, 1.0, dx_U), i + n[0]
    return slope, m_i, mv_p, transpose((mv_x, mv_y, mv_z))


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
