"""Records of four numbers, one for each node, which fit a vector register of the machine.

The record of a node holds the d components of a vector, then one more number, such as its mass,
then zeros. Records of the nodes of a line follow each other, so that a line is `lines.rows` of four
numbers. Compiled code reads arrays of records as flat; indices are unsigned (see `transfer_mls3`).
"""

from typing import NamedTuple

import numpy as np

from ..jit import leaf
from ..lines import (
    _1,
    _2,
    _3,
    _4,
    by_plane,
    grown,
    node_number,
    numbered,
    plus,
    rows,
    scaled,
    strides,
    summed,
)
from ..state import NONE
from ..stencil import locate, slopes_per_axis, weights_per_axis
from ..tensor import lin, transpose

WIDTH = 4       # numbers of a record


# grids of records

def packed_velocities(grid):
    """Return a grid of records of v and, where it is carried, v_old, (n1, .., nd, 4)."""
    return grid._replace(v=packed(grid.v), f=NONE, v_old=packed(grid.v_old))


def packed_bars(nodes):
    """Return a grid of records of v with m and, where it is carried, of f, (n1, .., nd, 4)."""
    return nodes._replace(v=packed(nodes.v, nodes.m), f=packed(nodes.f), v_old=NONE)


def packed(v, m=None):
    """Return the records (n1, .., nd, 4) of vectors v (n1, .., nd, d) and of numbers m (n1, ..,
    nd) or zeros; (0,) if v is.
    """
    if v.ndim == 1:
        return NONE
    d, packed_v = v.shape[-1], np.zeros((*v.shape[:-1], WIDTH))
    packed_v[..., :d] = v
    if m is not None:
        packed_v[..., d] = m
    return packed_v


def zero_records(grid):
    """Return a grid of records like `packed_velocities`, all zero."""
    v, v_old = (a if a.ndim == 1 else np.zeros((*a.shape[:-1], WIDTH))
                for a in (grid.v, grid.v_old))
    return grid._replace(v=v, f=NONE, v_old=v_old)


def unpack(records, nodes):
    """Copy the vectors of a grid of records to v and v_old of nodes."""
    nodes.v[:] = records.v[..., :nodes.v.shape[-1]]
    if nodes.v_old.ndim > 1:
        nodes.v_old[:] = records.v_old[..., :nodes.v.shape[-1]]


# one record

@leaf
def record_of(x, last):
    """The record of a vector and one more number."""
    if len(x) == 2:
        return x[0], x[1], last, 0.0
    else:
        return x[0], x[1], x[2], last


@leaf
def vector_in(x, like):
    """The vector of a record, as long as `like`."""
    if len(like) == 2:
        return x[0], x[1]
    else:
        return x[0], x[1], x[2]


@leaf
def last_in(x, like):
    """The number of a record behind its vector."""
    if len(like) == 2:
        return x[2]
    else:
        return x[3]


@leaf
def column_records(A):
    """The records of the columns of a matrix."""
    columns = transpose(A)
    if len(A) == 2:
        return record_of(columns[0], 0.0), record_of(columns[1], 0.0)
    else:
        return (record_of(columns[0], 0.0), record_of(columns[1], 0.0),
                record_of(columns[2], 0.0))


@leaf
def matrix_of(columns, like):
    """The matrix of the vectors in records, its columns; `like` is as long as a vector."""
    if len(like) == 2:
        return transpose((vector_in(columns[0], like), vector_in(columns[1], like)))
    else:
        return transpose((vector_in(columns[0], like), vector_in(columns[1], like),
                          vector_in(columns[2], like)))


@leaf
def record(v, i):
    """The four numbers of record i."""
    i = _4 * i
    return v[i], v[i + _1], v[i + _2], v[i + _3]


@leaf
def put_record(v, i, x):
    """Store record i."""
    i = _4 * i
    v[i], v[i + _1], v[i + _2], v[i + _3] = x


# lines of records

class Lines(NamedTuple):
    """The lines that a particle reaches, and the factors of its axes by plane, line and node."""

    i: np.uint64        # number of the base node in the flattened grid
    n: tuple            # nodes from one plane, and one line, to the next
    w: tuple            # weights; 1 for the one plane in 2D
    dw: tuple           # slopes; 0 for the one plane in 2D


@leaf
def lines_around(x, grid, stencil):
    """The `Lines` of a particle at x, and its weights, slopes and offset by axis."""
    base, s = locate(x, grid, stencil)
    w, dw, n = weights_per_axis(s, stencil), slopes_per_axis(s, stencil), strides(grid.m)
    return Lines(node_number(base, n), n, by_plane(w, 1.0), by_plane(dw, 0.0)), (w, dw, s)


@leaf
def line_of_records(v, i, w):
    """The rows of node i and those behind it, as many as weights."""
    if len(w) == 2:
        return record(v, i), record(v, i + _1)
    elif len(w) == 3:
        return record(v, i), record(v, i + _1), record(v, i + _2)
    else:
        return record(v, i), record(v, i + _1), record(v, i + _2), record(v, i + _3)


@leaf
def put_line_of_records(v, i, A):
    """Store the rows of node i and those behind it."""
    put_record(v, i, A[0])
    put_record(v, i + _1, A[1])
    if len(A) > 2:
        put_record(v, i + _2, A[2])
    if len(A) > 3:
        put_record(v, i + _3, A[3])


# what a particle brings: w_ip (U + Q r_ip) + dx S dw_ip; Q and S are records of columns, or ()

@leaf
def affine_rows(U, Q, s, w):
    """The rows of U + Q (k - s) along the first line, with the weights w, and their growth from
    plane to plane and from line to line; without Q the rows alone.
    """
    if len(Q) == 0:
        return (rows(w, U),)
    elif len(Q) == 2:
        base, growth = lin(1.0, lin(1.0, U, -s[0], Q[0]), -s[1], Q[1]), rows(w, Q[0])
        return plus(rows(w, base), 1.0, rows(numbered(w), Q[1])), growth, growth
    else:
        base = lin(1.0, lin(1.0, lin(1.0, U, -s[0], Q[0]), -s[1], Q[1]), -s[2], Q[2])
        A = plus(rows(w, base), 1.0, rows(numbered(w), Q[2]))
        return A, rows(w, Q[0]), rows(w, Q[1])


@leaf
def spread_affine(v, A, nodes):
    """v += w_a w_b (A + a A_x + b A_y) for line b of plane a, A of `affine_rows`."""
    i, n, w, _ = nodes
    first = A[0]
    for a in range(len(w[0])):
        line, j = first, i
        for b in range(len(w[1])):
            sums = plus(line_of_records(v, j, w[2]), w[0][a] * w[1][b], line)
            put_line_of_records(v, j, sums)
            line, j = grown(line, 1.0, A, 2), j + n[1]
        first, i = grown(first, 1.0, A, 1), i + n[0]


@leaf
def spread_sloped(v, A, S, nodes):
    """`spread_affine`, and v += S dw_ip dx of the columns S."""
    i, n, w, dw = nodes
    along, across = rows(dw[2], S[len(S) - 1]), rows(w[2], S[len(S) - 2])
    beyond = rows(w[2], S[0])
    first = plus(A[0], 1.0, along)
    for a in range(len(w[0])):
        P, R, j = plus(scaled(w[0][a], first), dw[0][a], beyond), scaled(w[0][a], across), i
        for b in range(len(w[1])):
            sums = plus(plus(line_of_records(v, j, w[2]), w[1][b], P), dw[1][b], R)
            put_line_of_records(v, j, sums)
            P, j = grown(P, w[0][a], A, 2), j + n[1]
        first, i = grown(first, 1.0, A, 1), i + n[0]


@leaf
def spread(v, field, s, nodes):
    """v += w_ip (U + Q r_ip) + dx S dw_ip of the field (U, Q, S), r_ip in cells."""
    U, Q, S = field
    spread_field(v, affine_rows(U, Q, s, nodes.w[2]), S, nodes)


@leaf
def spread_field(v, A, S, nodes):
    """`spread_affine` where S is (), else `spread_sloped`."""
    if len(S) == 0:
        spread_affine(v, A, nodes)
    else:
        spread_sloped(v, A, S, nodes)


# what a particle takes as its velocity gradient, in the order of `lines.sums_of`

@leaf
def gradient_columns(v, g, nodes, like):
    """The columns of sum_i v_i g_ip^T, where g_ip has the factor g in place of w for its axis."""
    i, n, w, _ = nodes
    A, R = plane_of_rows(v, i, g, nodes)
    W, X, Y = scaled(w[0][0], A), scaled(g[0][0], A), scaled(w[0][0], R)
    for a in range(1, len(w[0])):
        i += n[0]
        A, R = plane_of_rows(v, i, g, nodes)
        W, X, Y = plus(W, w[0][a], A), plus(X, g[0][a], A), plus(Y, w[0][a], R)
    if len(like) == 2:
        return summed(w[2], Y), summed(g[2], W)
    else:
        return summed(w[2], X), summed(w[2], Y), summed(g[2], W)


@leaf
def plane_of_rows(v, i, g, nodes):
    """Sums of the lines of a plane, which begins with node i, with the weights w and with g."""
    n, w = nodes.n[1], nodes.w
    line = line_of_records(v, i, w[2])
    A, R = scaled(w[1][0], line), scaled(g[1][0], line)
    for b in range(1, len(w[1])):
        i += n
        line = line_of_records(v, i, w[2])
        A, R = plus(A, w[1][b], line), plus(R, g[1][b], line)
    return A, R
