"""Slopes with the place of a particle, and matrices, from the sums of `moments`.

Of a field w_ip (U + Q r_ip) + dx S dw_ip, whose columns Q and S are records or (), and of records
q_i of nodes, the slope is dx d/dx_p of the sum over i of their products.
"""

from typing import NamedTuple

import numpy as np

from ..jit import leaf
from ..lines import plus, scaled, times
from ..tensor import lin
from .moments import put_first
from .records import record

# Rows of the array of sums (see `moments`).
_0, _1, _2, _3, _4, _5, _6, _7, _8, _9 = (np.uint64(k) for k in range(10))
_10, _11, _12, _13, _14, _15, _16 = (np.uint64(k) for k in range(10, 17))


class Arms(NamedTuple):
    """The numbers that turn sums with c into sums with arms (see `moments`)."""

    sigma: float
    rho: float
    kappa: tuple    # of each axis
    eta: tuple      # of each axis


@leaf
def arms_around(w, dw, s):
    """The `Arms` of a particle from its weights and slopes by axis."""
    sigma, rho = len(w[0]) / 12.0, 1.0 / 3.0 if len(w[0]) == 4 else 0.0
    if len(s) == 2:
        y, z = arm_of(w[0], dw[0], s[0]), arm_of(w[1], dw[1], s[1])
        return Arms(sigma, rho, (y[0], z[0]), (y[1], z[1]))
    else:
        x, y = arm_of(w[0], dw[0], s[0]), arm_of(w[1], dw[1], s[1])
        z = arm_of(w[2], dw[2], s[2])
        return Arms(sigma, rho, (x[0], y[0], z[0]), (x[1], y[1], z[1]))


@leaf
def arm_of(w, dw, s):
    """kappa and eta of one axis, from its last node."""
    r, last = len(w) - 1 - s, len(w) - 1
    kappa, eta = w[last] * r - len(w) / 12.0 * dw[last], dw[last] * r - w[last]
    if len(w) == 4:
        return kappa, eta - (s - 1.0) / 3.0
    else:
        return kappa, eta


# what follows from the sums of a field w_ip (U + Q r_ip) + dx S dw_ip

@leaf
def moment_columns(M, arms, like):
    """Records of sum_i w_ip q_i r_ip^T/dx, its columns."""
    t, k = arms.sigma, arms.kappa
    y = lin(t, record(M, _1), k[0], record(M, _4)), lin(t, record(M, _2), k[1], record(M, _5))
    if len(like) == 2:
        return y
    else:
        return (*y, lin(t, record(M, _3), k[2], record(M, _6)))


@leaf
def slope_columns(M, like):
    """Records of dx sum_i q_i dw_ip^T, its columns."""
    if len(like) == 2:
        return record(M, _1), record(M, _2)
    else:
        return record(M, _1), record(M, _2), record(M, _3)


@leaf
def slopes(X, M, field, arms, stencil):
    """dx d/dx_p of sum_i q_i . (w_ip (U + Q r_ip) + dx S dw_ip), from the sums of `put_sums`; X
    has room for three records.
    """
    U, Q, S = field
    by = coupling(Q, S, arms, stencil)
    x = plain_slopes(M, U, arms.kappa)
    x = plus_slopes_of_pairs(plus_own(x, by.C, M, _4), by.DD, M)
    put_first(X, _0, plus_pairs(plus_own(x, by.N2, M, _16), by.DC, M))
    return totals(X, arms.kappa)


class Coupling(NamedTuple):
    """The records by which a field multiplies each kind of sum, by axis; () where it has none."""

    DD: tuple
    DC: tuple
    C: tuple
    N2: tuple       # of [N''_a] of cubic splines


@leaf
def coupling(Q, S, arms, stencil):
    """The `Coupling` of the columns Q and S."""
    if len(Q) == 0:
        return Coupling(S, (), S, ())
    elif len(stencil) == 4:
        R = with_columns(scaled(arms.rho, Q), S)
        return Coupling(with_columns(scaled(arms.sigma, Q), S), each(arms.kappa, Q),
                        each(arms.eta, Q), R)
    else:
        return Coupling(with_columns(scaled(arms.sigma, Q), S), each(arms.kappa, Q),
                        with_columns(each(arms.eta, Q), S), ())


@leaf
def with_columns(A, S):
    """A + S, or A where S is ()."""
    if len(S) == 0:
        return A
    else:
        return plus(A, 1.0, S)


@leaf
def each(a, Q):
    """a_b Q_b of each column."""
    if len(Q) == 2:
        return times(a[0], Q[0]), times(a[1], Q[1])
    else:
        return times(a[0], Q[0]), times(a[1], Q[1]), times(a[2], Q[2])


@leaf
def product(x, y):
    """The products of the numbers of two records."""
    return x[0] * y[0], x[1] * y[1], x[2] * y[2], x[3] * y[3]


@leaf
def plus_product(a, x, y):
    """a + `product`."""
    return a[0] + x[0] * y[0], a[1] + x[1] * y[1], a[2] + x[2] * y[2], a[3] + x[3] * y[3]


@leaf
def plus_own(x, A, M, row):
    """x_a + A_a [f_a] of the sums from a row on."""
    if len(A) == 0:
        return x
    elif len(A) == 2:
        return (plus_product(x[0], A[0], record(M, row)),
                plus_product(x[1], A[1], record(M, row + _1)))
    else:
        return (plus_product(x[0], A[0], record(M, row)),
                plus_product(x[1], A[1], record(M, row + _1)),
                plus_product(x[2], A[2], record(M, row + _2)))


@leaf
def plus_slopes_of_pairs(x, A, M):
    """x_a + sum_b A_b DD_ab over the other axes b."""
    if len(A) == 0:
        return x
    elif len(A) == 2:
        yz = record(M, _7)
        return plus_product(x[0], A[1], yz), plus_product(x[1], A[0], yz)
    else:
        xy, xz, yz = record(M, _7), record(M, _8), record(M, _9)
        return (plus_product(plus_product(x[0], A[1], xy), A[2], xz),
                plus_product(plus_product(x[1], A[0], xy), A[2], yz),
                plus_product(plus_product(x[2], A[0], xz), A[1], yz))


@leaf
def plus_pairs(x, A, M):
    """x_a + sum_b A_b DC_ab over the other axes b."""
    if len(A) == 0:
        return x
    elif len(A) == 2:
        return (plus_product(x[0], A[1], record(M, _10)),
                plus_product(x[1], A[0], record(M, _12)))
    else:
        return (plus_product(plus_product(x[0], A[1], record(M, _10)), A[2], record(M, _11)),
                plus_product(plus_product(x[1], A[0], record(M, _12)), A[2], record(M, _13)),
                plus_product(plus_product(x[2], A[0], record(M, _14)), A[1], record(M, _15)))


@leaf
def plain_slopes(M, U, like):
    """U D_a of each axis."""
    if len(like) == 2:
        return product(U, record(M, _1)), product(U, record(M, _2))
    else:
        return product(U, record(M, _1)), product(U, record(M, _2)), product(U, record(M, _3))


@leaf
def totals(X, like):
    """The sum of each of the records X, a vector."""
    if len(like) == 2:
        return total(record(X, _0)), total(record(X, _1))
    else:
        return total(record(X, _0)), total(record(X, _1)), total(record(X, _2))


@leaf
def total(x):
    """The sum of the numbers of a record."""
    return (x[0] + x[1]) + (x[2] + x[3])
