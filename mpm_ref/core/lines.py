"""Lines of nodes: sums over a stencil for which the compiler uses vector registers, in 2D and 3D.

The nodes of a stencil along the last axis, a line, hold consecutive numbers: a matrix with a row
for each node, here `rows`. A stencil is planes of lines of nodes; in 2D it is one plane, of weight
1. What a particle brings to the lines, and takes from them, are sums of few such matrices,

    A_ab = w_a w_b (A + a A_x + b A_y)                an affine field; A_x, A_y: growth by node
    S_ab = w_a w_b S + dw_a w_b S_x + w_a dw_b S_y    the force of the gradient form

Indices are unsigned (see `transfer_mls3`). `transfer_lines` puts the sums together.
"""

from typing import NamedTuple

import numpy as np

from .jit import kernel, leaf
from .tensor import lin, transpose

# Offsets in an array, unsigned as the indices are: their sum with a signed integer is a float.
_1, _2, _3, _4, _5, _6, _7, _8, _9, _10, _11 = (np.uint64(k) for k in range(1, 12))


# rows: one for each of the 2, 3 or 4 nodes of a line, of d numbers each

@kernel
def times(a, x):
    """Return a x of a vector, or of four numbers."""
    if len(x) == 2:
        return a * x[0], a * x[1]
    elif len(x) == 3:
        return a * x[0], a * x[1], a * x[2]
    else:
        return a * x[0], a * x[1], a * x[2], a * x[3]


@kernel
def rows(w, x):
    """The rows w_k x."""
    if len(w) == 2:
        return times(w[0], x), times(w[1], x)
    elif len(w) == 3:
        return times(w[0], x), times(w[1], x), times(w[2], x)
    else:
        return times(w[0], x), times(w[1], x), times(w[2], x), times(w[3], x)


@kernel
def plus(A, b, B):
    """Return A + b B of rows."""
    if len(A) == 2:
        return lin(1.0, A[0], b, B[0]), lin(1.0, A[1], b, B[1])
    elif len(A) == 3:
        return lin(1.0, A[0], b, B[0]), lin(1.0, A[1], b, B[1]), lin(1.0, A[2], b, B[2])
    else:
        return (lin(1.0, A[0], b, B[0]), lin(1.0, A[1], b, B[1]), lin(1.0, A[2], b, B[2]),
                lin(1.0, A[3], b, B[3]))


@kernel
def scaled(a, A):
    """Return a A of rows."""
    if len(A) == 2:
        return times(a, A[0]), times(a, A[1])
    elif len(A) == 3:
        return times(a, A[0]), times(a, A[1]), times(a, A[2])
    else:
        return times(a, A[0]), times(a, A[1]), times(a, A[2]), times(a, A[3])


@kernel
def summed(w, A):
    """Return sum_k w_k A_k of rows, a vector."""
    if len(w) == 2:
        return lin(w[0], A[0], w[1], A[1])
    elif len(w) == 3:
        return lin(1.0, lin(w[0], A[0], w[1], A[1]), w[2], A[2])
    else:
        return lin(1.0, lin(w[0], A[0], w[1], A[1]), 1.0, lin(w[2], A[2], w[3], A[3]))


@kernel
def line_at(v, i, w, like):
    """The rows of node i and those behind it, as many as weights; vectors as long as `like`."""
    if len(like) == 2:
        i = i + i
        a, b = (v[i], v[i + _1]), (v[i + _2], v[i + _3])
        if len(w) == 2:
            return a, b
        elif len(w) == 3:
            return a, b, (v[i + _4], v[i + _5])
        else:
            return a, b, (v[i + _4], v[i + _5]), (v[i + _6], v[i + _7])
    else:
        i = _3 * i
        a, b = (v[i], v[i + _1], v[i + _2]), (v[i + _3], v[i + _4], v[i + _5])
        if len(w) == 2:
            return a, b
        elif len(w) == 3:
            return a, b, (v[i + _6], v[i + _7], v[i + _8])
        else:
            return a, b, (v[i + _6], v[i + _7], v[i + _8]), (v[i + _9], v[i + _10], v[i + _11])


@kernel
def put_line(v, i, A, like):
    """Store the rows of node i and those behind it."""
    if len(like) == 2:
        i = i + i
        v[i], v[i + _1] = A[0]
        v[i + _2], v[i + _3] = A[1]
        if len(A) > 2:
            v[i + _4], v[i + _5] = A[2]
        if len(A) > 3:
            v[i + _6], v[i + _7] = A[3]
    else:
        i = _3 * i
        v[i], v[i + _1], v[i + _2] = A[0]
        v[i + _3], v[i + _4], v[i + _5] = A[1]
        if len(A) > 2:
            v[i + _6], v[i + _7], v[i + _8] = A[2]
        if len(A) > 3:
            v[i + _9], v[i + _10], v[i + _11] = A[3]


@kernel
def add_mass_line(m, i, mass, w):
    """m += mass w at the nodes of a line; all are read before any is written, as vectors."""
    if len(w) == 2:
        m[i], m[i + _1] = m[i] + mass * w[0], m[i + _1] + mass * w[1]
    elif len(w) == 3:
        a, b, c = m[i] + mass * w[0], m[i + _1] + mass * w[1], m[i + _2] + mass * w[2]
        m[i], m[i + _1], m[i + _2] = a, b, c
    else:
        a, b = m[i] + mass * w[0], m[i + _1] + mass * w[1]
        c, d = m[i + _2] + mass * w[2], m[i + _3] + mass * w[3]
        m[i], m[i + _1], m[i + _2], m[i + _3] = a, b, c, d


# the stencil: planes, lines, nodes

class NodeLines(NamedTuple):
    """The lines that a particle reaches, and its weights by plane, line and node."""

    i: np.uint64        # number of the base node in the flattened grid
    n: tuple            # nodes from one plane, and one line, to the next
    w: tuple            # weights of planes, of lines, and of the nodes of a line
    dw: tuple           # slopes likewise; 0 for the one plane in 2D
    r: tuple            # w_k (k - s) likewise, arms times weights
    s: tuple            # offset of the particle from the base node [cells]


@kernel
def by_plane(w, of_plane):
    """Weights of planes, lines and nodes from those of the axes; in 2D `of_plane` is that of the
    one plane.
    """
    if len(w) == 2:
        return (of_plane,), w[0], w[1]
    else:
        return w


@kernel
def strides(m):
    """Nodes from one plane, and one line, to the next; the one plane in 2D has no next."""
    n = np.uint64(m.shape[m.ndim - 1])
    return (n if m.ndim == 2 else np.uint64(m.shape[1]) * n), n


@kernel
def node_number(base, n):
    """Number of the base node in the flattened grid."""
    if len(base) == 2:
        return np.uint64(base[0]) * n[1] + np.uint64(base[1])
    else:
        return np.uint64(base[0]) * n[0] + np.uint64(base[1]) * n[1] + np.uint64(base[2])


@kernel
def arms(w, s):
    """w_k (k - s) along one axis."""
    if len(w) == 2:
        return (0.0 - s) * w[0], (1.0 - s) * w[1]
    elif len(w) == 3:
        return (0.0 - s) * w[0], (1.0 - s) * w[1], (2.0 - s) * w[2]
    else:
        return (0.0 - s) * w[0], (1.0 - s) * w[1], (2.0 - s) * w[2], (3.0 - s) * w[3]


@kernel
def arms_per_axis(w, s):
    """w_k (k - s) of each axis."""
    if len(w) == 2:
        return arms(w[0], s[0]), arms(w[1], s[1])
    else:
        return arms(w[0], s[0]), arms(w[1], s[1]), arms(w[2], s[2])


# what a particle brings

@kernel
def affine_rows(x_0, Q, w):
    """A, A_x, A_y of a field x_0 + Q k of the nodes k, with the weights w along a line. In 2D
    nothing grows from plane to plane.
    """
    columns, z = transpose(Q), numbered(w)
    if len(x_0) == 2:
        growth = rows(w, columns[0])
        return plus(rows(w, x_0), 1.0, rows(z, columns[1])), growth, growth
    else:
        A = plus(rows(w, x_0), 1.0, rows(z, columns[2]))
        return A, rows(w, columns[0]), rows(w, columns[1])


@kernel
def numbered(w):
    """k w_k along one axis."""
    if len(w) == 2:
        return 0.0, w[1]
    elif len(w) == 3:
        return 0.0, w[1], 2.0 * w[2]
    else:
        return 0.0, w[1], 2.0 * w[2], 3.0 * w[3]


@kernel
def force_rows(T, w, dw):
    """S, S_x, S_y of the force T dw_ip, with weights and slopes along a line."""
    columns = transpose(T)
    if len(T) == 2:
        across = rows(w, columns[0])
        return rows(dw, columns[1]), across, across
    else:
        return rows(dw, columns[2]), rows(w, columns[0]), rows(w, columns[1])


@kernel
def grown(A, weight, field, k):
    """A + weight times the growth of an affine field, A_x for k = 1, A_y for 2; a constant field,
    which is one matrix alone, does not grow.
    """
    if len(field) == 3:
        return plus(A, weight, field[k])
    else:
        return A


@leaf
def spread_mass(m, mass, nodes):
    """m += w_a w_b w_c mass."""
    i, n, w, _, _, _ = nodes
    for a in range(len(w[0])):
        j = i
        for b in range(len(w[1])):
            add_mass_line(m, j, w[0][a] * w[1][b] * mass, w[2])
            j += n[1]
        i += n[0]


@leaf
def spread(v, A, nodes):
    """v += A_ab of a field that is affine or constant."""
    i, n, w, _, _, s = nodes
    first = A[0]
    for a in range(len(w[0])):
        line, j = first, i
        for b in range(len(w[1])):
            line_ab = plus(line_at(v, j, w[2], s), w[0][a] * w[1][b], line)
            put_line(v, j, line_ab, s)
            line, j = grown(line, 1.0, A, 2), j + n[1]
        first, i = grown(first, 1.0, A, 1), i + n[0]


@leaf
def spread_force(v, S, nodes):
    """v += S_ab."""
    i, n, w, dw, _, s = nodes
    for a in range(len(w[0])):
        P, R, j = plus(scaled(w[0][a], S[0]), dw[0][a], S[1]), scaled(w[0][a], S[2]), i
        for b in range(len(w[1])):
            line = plus(line_at(v, j, w[2], s), w[1][b], P)
            put_line(v, j, plus(line, dw[1][b], R), s)
            j += n[1]
        i += n[0]


@leaf
def spread_all(m, v, mass, A, S, nodes):
    """`spread_mass`, `spread` and `spread_force` at once."""
    i, n, w, dw, _, s = nodes
    first = plus(A[0], 1.0, S[0])
    for a in range(len(w[0])):
        P, R, j = plus(scaled(w[0][a], first), dw[0][a], S[1]), scaled(w[0][a], S[2]), i
        for b in range(len(w[1])):
            add_mass_line(m, j, w[0][a] * w[1][b] * mass, w[2])
            line = plus(line_at(v, j, w[2], s), w[1][b], P)
            put_line(v, j, plus(line, dw[1][b], R), s)
            P, j = grown(P, w[0][a], A, 2), j + n[1]
        first, i = grown(first, 1.0, A, 1), i + n[0]


# what a particle takes

@kernel
def gradient_of(x, y, z):
    """Matrix of the columns x, y, z; in 2D of y, z."""
    if len(x) == 2:
        return (y[0], z[0]), (y[1], z[1])
    else:
        return transpose((x, y, z))


@leaf
def mean_of(v, nodes):
    """u = sum_i w_ip v_i."""
    i, n, w, _, _, s = nodes
    W = scaled(0.0, line_at(v, i, w[2], s))
    for a in range(len(w[0])):
        j = i
        for b in range(len(w[1])):
            W, j = plus(W, w[0][a] * w[1][b], line_at(v, j, w[2], s)), j + n[1]
        i += n[0]
    return summed(w[2], W)


@leaf
def sums_of(v, g, nodes):
    """u = sum_i w_ip v_i, and sum_i v_i g_ip^T, where g_ip has the factor g, which is dw or r, in
    place of w for its own axis: (g_a w_b w_c, w_a g_b w_c, w_a w_b g_c).
    """
    i, n, w, _, _, _ = nodes
    A, R = plane(v, i, g, nodes)
    W, X, Y = scaled(w[0][0], A), scaled(g[0][0], A), scaled(w[0][0], R)
    for a in range(1, len(w[0])):
        i += n[0]
        A, R = plane(v, i, g, nodes)
        W, X, Y = plus(W, w[0][a], A), plus(X, g[0][a], A), plus(Y, w[0][a], R)
    return summed(w[2], W), gradient_of(summed(w[2], X), summed(w[2], Y), summed(g[2], W))


@leaf
def plane(v, i, g, nodes):
    """Sums of the lines of a plane, which begins with node i, with the weights w and with g."""
    _, n, w, _, _, s = nodes
    line = line_at(v, i, w[2], s)
    A, R = scaled(w[1][0], line), scaled(g[1][0], line)
    for b in range(1, len(w[1])):
        i += n[1]
        line = line_at(v, i, w[2], s)
        A, R = plus(A, w[1][b], line), plus(R, g[1][b], line)
    return A, R


@leaf
def both_sums_of(v, nodes):
    """`sums_of` with the factors dw and with r at once: u, and both matrices."""
    i, n, w, dw, r, _ = nodes
    A, D, R = plane_of_both(v, i, nodes)
    W, X, Y = scaled(w[0][0], A), scaled(dw[0][0], A), scaled(w[0][0], D)
    Z, T = scaled(r[0][0], A), scaled(w[0][0], R)
    for a in range(1, len(w[0])):
        i += n[0]
        A, D, R = plane_of_both(v, i, nodes)
        W, X, Y = plus(W, w[0][a], A), plus(X, dw[0][a], A), plus(Y, w[0][a], D)
        Z, T = plus(Z, r[0][a], A), plus(T, w[0][a], R)
    G = gradient_of(summed(w[2], X), summed(w[2], Y), summed(dw[2], W))
    B = gradient_of(summed(w[2], Z), summed(w[2], T), summed(r[2], W))
    return summed(w[2], W), G, B


@leaf
def plane_of_both(v, i, nodes):
    """`plane` with the weights w, dw and r."""
    _, n, w, dw, r, s = nodes
    line = line_at(v, i, w[2], s)
    A, D, R = scaled(w[1][0], line), scaled(dw[1][0], line), scaled(r[1][0], line)
    for b in range(1, len(w[1])):
        i += n[1]
        line = line_at(v, i, w[2], s)
        A, D, R = plus(A, w[1][b], line), plus(D, dw[1][b], line), plus(R, r[1][b], line)
    return A, D, R
