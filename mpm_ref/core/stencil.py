"""The nodes around a point: which they are, their weights, and how to reach them, in 2D and 3D
from one text.

A stencil is walked column by column: a column is a run of nodes along the last axis. Node (k, l)
of the stencil has offset k on all axes but the last (k is padded by 0 to d entries) and l on the
last.
"""

from .block_table import block_of, row_of
from .jit import kernel
from .spline import base_of, slopes, weights
from .tensor import number


@kernel
def locate(x, grid, stencil):
    """Base node of the point x, as an index in the grid's arrays, and its offset s = x/dx - base
    [cells].
    """
    dx, o = grid.dx, grid.origin
    if len(x) == 2:
        i, j = base_of(x[0], dx, stencil), base_of(x[1], dx, stencil)
        s = offset(x[0] / dx, i), offset(x[1] / dx, j)
        return in_arrays((i, j), o), s
    else:
        i, j, k = base_of(x[0], dx, stencil), base_of(x[1], dx, stencil), base_of(x[2], dx, stencil)
        s = offset(x[0] / dx, i), offset(x[1] / dx, j), offset(x[2] / dx, k)
        return in_arrays((i, j, k), o), s


@kernel
def offset(xi, i):
    """Return xi - i of a coordinate xi and the number i of a node [cells]."""
    return xi - number(i, xi)


@kernel
def in_arrays(i, origin):
    """Index in a grid's arrays of the base node i, counted from the world's origin; origin is that
    of a `Grid` or of a `SparseGrid` (see `state`).
    """
    if origin.ndim == 1:
        return minus_origin(i, origin)
    else:
        return plus_shift(i, origin, row_of(origin, block_of(i)))


@kernel
def minus_origin(i, origin):
    """The index i from a grid's first node on."""
    if len(i) == 2:
        return i[0] - origin[0], i[1] - origin[1]
    else:
        return i[0] - origin[0], i[1] - origin[1], i[2] - origin[2]


@kernel
def plus_shift(i, table, row):
    """The index i with the shift of a block, which follows it in its row of a table."""
    if len(i) == 2:
        return i[0] + table[row, 2], i[1] + table[row, 3]
    else:
        return i[0] + table[row, 3], i[1] + table[row, 4], i[2] + table[row, 5]


@kernel
def weights_per_axis(s, stencil):
    """w[a][k] = N(s_a - k)."""
    if len(s) == 2:
        return weights(s[0], stencil), weights(s[1], stencil)
    else:
        return weights(s[0], stencil), weights(s[1], stencil), weights(s[2], stencil)


@kernel
def slopes_per_axis(s, stencil):
    """dw[a][k] = N'(s_a - k)."""
    if len(s) == 2:
        return slopes(s[0], stencil), slopes(s[1], stencil)
    else:
        return slopes(s[0], stencil), slopes(s[1], stencil), slopes(s[2], stencil)


@kernel
def columns(s, stencil):
    """Number of columns of the stencil: width^(d-1)."""
    if len(s) == 2:
        return len(stencil)
    else:
        return len(stencil) * len(stencil)


@kernel
def column(c, stencil, like):
    """Offsets k of column c."""
    if len(like) == 2:
        return c, 0
    else:
        return c // len(stencil), c % len(stencil), 0


@kernel
def product(k, l, w):
    """w_ip of node (k, l): the product of the weights of the axes."""
    if len(k) == 2:
        return w[0][k[0]] * w[1][l]
    else:
        return w[0][k[0]] * w[1][k[1]] * w[2][l]


@kernel
def gradient(k, l, w, dw, dx):
    """dw_ip/dx_p of node (k, l) [1/m]."""
    if len(k) == 2:
        return dw[0][k[0]] * w[1][l] / dx, w[0][k[0]] * dw[1][l] / dx
    else:
        return (
            dw[0][k[0]] * w[1][k[1]] * w[2][l] / dx,
            w[0][k[0]] * dw[1][k[1]] * w[2][l] / dx,
            w[0][k[0]] * w[1][k[1]] * dw[2][l] / dx,
        )


@kernel
def arm(k, l, s, dx):
    """r_ip = x_i - x_p of node (k, l) [m]."""
    if len(k) == 2:
        return (k[0] - s[0]) * dx, (l - s[1]) * dx
    else:
        return (k[0] - s[0]) * dx, (k[1] - s[1]) * dx, (l - s[2]) * dx


@kernel
def node(base, k, l):
    """Index of node (k, l) in the grid's arrays."""
    if len(base) == 2:
        return base[0] + k[0], base[1] + l
    else:
        return base[0] + k[0], base[1] + k[1], base[2] + l


@kernel
def inverse_inertia(dx, stencil):
    """D^-1 of sum_i w_ip r_ip r_ip^T = dx^2 (degree + 1)/12 I [1/m^2]; degrees 2 and 3 only
    (NSF-alg-mpm).
    """
    return 12.0 / (number(len(stencil), dx) * dx**2)


@kernel
def of_node(v, i):
    """Vector of node i."""
    if len(i) == 2:
        return v[i[0], i[1], 0], v[i[0], i[1], 1]
    else:
        return v[i[0], i[1], i[2], 0], v[i[0], i[1], i[2], 1], v[i[0], i[1], i[2], 2]


@kernel
def add_to_node(v, i, dv):
    """Add to the vector of node i."""
    if len(i) == 2:
        v[i[0], i[1], 0] += dv[0]
        v[i[0], i[1], 1] += dv[1]
    else:
        v[i[0], i[1], i[2], 0] += dv[0]
        v[i[0], i[1], i[2], 1] += dv[1]
        v[i[0], i[1], i[2], 2] += dv[2]
