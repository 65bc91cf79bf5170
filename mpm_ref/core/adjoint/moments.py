"""Sums over the nodes of a stencil from which all bars of a particle follow, in 2D and 3D.

With q_i the record of node i (see `records`), the factors w and dw = N' of each axis, and a third
factor c, these sums are

    W = [w]    D_a = [dw_a]    C_a = [c_a]    DD_ab = [dw_a dw_b]    DC_ab = [dw_a c_b]

where [f] = sum_i f_ip q_i, and axes that f does not name have the factor w. For a field that is
affine c is the highest derivative of N that is not zero, a constant; else it is N''. The arms k - s
of nodes need no sums of their own: splines reproduce polynomials, so that for degrees 2 and 3

    w_k (k - s) = sigma dw_k + kappa c_k        dw_k (k - s) = w_k + rho N''_k + eta c_k

with sigma = (degree + 1)/12, rho = 0 or 1/3, and kappa and eta by the place of the particle, which
follow from the last node, where c_k = 1.
"""

import numpy as np

from ..jit import kernel, leaf
from ..lines import by_plane, summed, times
from ..tensor import lin
from .records import line_of_records, put_record
from .shape_gradient import curvatures_per_axis

# Sums stand in an array of records: W, then D, C, DD, DC and, for an affine field of cubic splines,
# [N''_a]. Pairs of axes are 01, 02, 12, and for DC 01, 02, 10, 12, 20, 21.
_0, _1, _2, _3, _4, _5, _6, _7, _8, _9 = (np.uint64(k) for k in range(10))
_10, _11, _12, _13, _14, _15, _16 = (np.uint64(k) for k in range(10, 17))
MEAN, SUMS = _0, 19


# the third factor

@leaf
def highest(stencil):
    """The highest derivative of N at each node of an axis."""
    if len(stencil) == 2:
        return -1.0, 1.0
    elif len(stencil) == 3:
        return 1.0, -2.0, 1.0
    else:
        return -1.0, 3.0, -3.0, 1.0


@leaf
def third_factors(Q, s, stencil):
    """c by plane, line and node, of a field with the columns Q or ()."""
    if len(Q) == 0:
        return curvature_factors(s, stencil)
    elif len(s) == 2:
        return by_plane((highest(stencil), highest(stencil)), 0.0)
    else:
        return highest(stencil), highest(stencil), highest(stencil)


@leaf
def curvature_factors(s, stencil):
    """N'' by plane, line and node."""
    return by_plane(curvatures_per_axis(s, stencil), 0.0)


# sums of a plane

@leaf
def plane_of_first(v, i, nodes, g):
    """[w w], [g w], [w g] of the plane that begins with node i."""
    n, w, z = nodes.n[1], nodes.w[1], nodes.w[2]
    line = line_of_records(v, i, z)
    W, G = summed(z, line), summed(g[2], line)
    ww, gw, wg = times(w[0], W), times(g[1][0], W), times(w[0], G)
    for b in range(1, len(w)):
        i += n
        line = line_of_records(v, i, z)
        W, G = summed(z, line), summed(g[2], line)
        ww, gw, wg = lin(1.0, ww, w[b], W), lin(1.0, gw, g[1][b], W), lin(1.0, wg, w[b], G)
    return ww, gw, wg


@leaf
def plane_of_all(v, i, nodes, c):
    """[w w], [dw w], [c w], [w dw], [dw dw], [c dw], [w c], [dw c] of the plane from node i on."""
    n, w, dw = nodes.n[1], nodes.w, nodes.dw
    line = line_of_records(v, i, w[2])
    W, D, C = summed(w[2], line), summed(dw[2], line), summed(c[2], line)
    f, g, h = w[1][0], dw[1][0], c[1][0]
    ww, dw_w, cw = times(f, W), times(g, W), times(h, W)
    wd, dd, cd = times(f, D), times(g, D), times(h, D)
    wc, dc = times(f, C), times(g, C)
    for b in range(1, len(w[1])):
        i += n
        line = line_of_records(v, i, w[2])
        W, D, C = summed(w[2], line), summed(dw[2], line), summed(c[2], line)
        f, g, h = w[1][b], dw[1][b], c[1][b]
        ww, dw_w, cw = lin(1.0, ww, f, W), lin(1.0, dw_w, g, W), lin(1.0, cw, h, W)
        wd, dd, cd = lin(1.0, wd, f, D), lin(1.0, dd, g, D), lin(1.0, cd, h, D)
        wc, dc = lin(1.0, wc, f, C), lin(1.0, dc, g, C)
    return ww, dw_w, cw, wd, dd, cd, wc, dc


# sums of the stencil

@leaf
def first_sums(v, nodes, g, like):
    """W, and the tuple of [g_a]."""
    i, n, w, _ = nodes
    P = plane_of_first(v, i, nodes, g)
    if len(like) == 2:
        return P[0], (P[1], P[2])
    else:
        W, X, Y, Z = times(w[0][0], P[0]), times(g[0][0], P[0]), times(w[0][0], P[1]), \
            times(w[0][0], P[2])
        for a in range(1, len(w[0])):
            i += n[0]
            P = plane_of_first(v, i, nodes, g)
            W, X = lin(1.0, W, w[0][a], P[0]), lin(1.0, X, g[0][a], P[0])
            Y, Z = lin(1.0, Y, w[0][a], P[1]), lin(1.0, Z, w[0][a], P[2])
        return W, (X, Y, Z)


@leaf
def put_first(M, row, sums):
    """Store the tuple of [g_a] from a row on."""
    put_record(M, row, sums[0])
    put_record(M, row + _1, sums[1])
    if len(sums) == 3:
        put_record(M, row + _2, sums[2])


@kernel
def put_all(M, v, nodes, c, Q):
    """Store W, D, C, DD in 3D, and DC where columns Q are not ()."""
    i, n, w, dw = nodes
    ww, dy, cy, dz, dydz, cydz, cz, dycz = plane_of_all(v, i, nodes, c)
    f, g, h = w[0][0], dw[0][0], c[0][0]
    W, X, A = times(f, ww), times(g, ww), times(h, ww)
    Y, XY, AY = times(f, dy), times(g, dy), times(h, dy)
    B, XB = times(f, cy), times(g, cy)
    Z, XZ, AZ = times(f, dz), times(g, dz), times(h, dz)
    YZ, BZ = times(f, dydz), times(f, cydz)
    C, XC, YC = times(f, cz), times(g, cz), times(f, dycz)
    for a in range(1, len(w[0])):
        i += n[0]
        ww, dy, cy, dz, dydz, cydz, cz, dycz = plane_of_all(v, i, nodes, c)
        f, g, h = w[0][a], dw[0][a], c[0][a]
        W, X, A = lin(1.0, W, f, ww), lin(1.0, X, g, ww), lin(1.0, A, h, ww)
        Y, XY, AY = lin(1.0, Y, f, dy), lin(1.0, XY, g, dy), lin(1.0, AY, h, dy)
        B, XB = lin(1.0, B, f, cy), lin(1.0, XB, g, cy)
        Z, XZ, AZ = lin(1.0, Z, f, dz), lin(1.0, XZ, g, dz), lin(1.0, AZ, h, dz)
        YZ, BZ = lin(1.0, YZ, f, dydz), lin(1.0, BZ, f, cydz)
        C, XC, YC = lin(1.0, C, f, cz), lin(1.0, XC, g, cz), lin(1.0, YC, f, dycz)
    put_record(M, _0, W)
    put_first(M, _1, (X, Y, Z))
    put_first(M, _4, (A, B, C))
    put_first(M, _7, (XY, XZ, YZ))
    if len(Q) > 0:
        put_first(M, _10, (XB, XC, AY))
        put_first(M, _13, (YC, AZ, BZ))


@leaf
def put_all_in_plane(M, v, nodes, c):
    """Store W, D, C, DD, DC in 2D."""
    ww, dy, cy, dz, dydz, cydz, cz, dycz = plane_of_all(v, nodes.i, nodes, c)
    put_record(M, _0, ww)
    put_first(M, _1, (dy, dz))
    put_first(M, _4, (cy, cz))
    put_record(M, _7, dydz)
    put_record(M, _10, dycz)
    put_record(M, _12, cydz)


@leaf
def put_sums(M, v, field, nodes, around):
    """Store the sums that `slopes` takes for a field (U, Q, S); around = (s, stencil)."""
    _, Q, S = field
    put_sums_for(M, v, Q, Q + S, nodes, around)


@leaf
def put_sums_for(M, v, Q, columns, nodes, around):
    """`put_sums` of the columns Q, and of all columns, Q and S."""
    s, stencil = around
    if len(columns) == 0:
        W, D = first_sums(v, nodes, nodes.dw, s)
        put_record(M, _0, W)
        put_first(M, _1, D)
    else:
        c = third_factors(Q, s, stencil)
        put_curved_sums(M, v, nodes, c, Q, s)
        put_curvatures(M, v, nodes, Q, around)


@leaf
def put_curved_sums(M, v, nodes, c, Q, like):
    """`put_all` in 2D or 3D."""
    if len(like) == 2:
        put_all_in_plane(M, v, nodes, c)
    else:
        put_all(M, v, nodes, c, Q)


@leaf
def put_curvatures(M, v, nodes, Q, around):
    """Store [N''_a], where it is not C."""
    if len(Q) > 0:
        put_cubic_curvatures(M, v, nodes, around[1], around[0])


@kernel
def put_cubic_curvatures(M, v, nodes, stencil, s):
    """Store [N''_a] of cubic splines."""
    if len(stencil) == 4:
        _, E = first_sums(v, nodes, curvature_factors(s, stencil), s)
        put_first(M, _16, E)
