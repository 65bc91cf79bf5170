"""Vectors and matrices of two or three dimensions as nested tuples: one source for 2D and 3D.

A vector is `(a0, a1[, a2])`, a matrix a tuple of its rows. The dimension is the length of the
tuple, hence known when a kernel is compiled: `len(argument)` is settled before typing, and the
untaken branch costs nothing. Arguments named `like` only lend their length.
"""

from math import sqrt

import numpy as np

from .jit import kernel


@kernel
def number(i, like):
    """The number i as a float of the precision of `like`."""
    return type(like)(i)


@kernel
def vector_of(x, like):
    """The vector x with floats of the precision of the number `like`."""
    if len(x) == 2:
        return number(x[0], like), number(x[1], like)
    else:
        return number(x[0], like), number(x[1], like), number(x[2], like)


@kernel
def numbers(A, like):
    """The matrix A with floats of the precision of the number `like`."""
    if len(A) == 2:
        return vector_of(A[0], like), vector_of(A[1], like)
    else:
        return vector_of(A[0], like), vector_of(A[1], like), vector_of(A[2], like)


@kernel
def doubles(A):
    """The matrix A in double precision."""
    return numbers(A, np.float64(A[0][0]))


@kernel
def vec(a, p, like):
    """Row p of an (N, d) array."""
    if len(like) == 2:
        return a[p, 0], a[p, 1]
    else:
        return a[p, 0], a[p, 1], a[p, 2]


@kernel
def mat(a, p, like):
    """Matrix p of an (N, d, d) array."""
    if len(like) == 2:
        return (a[p, 0, 0], a[p, 0, 1]), (a[p, 1, 0], a[p, 1, 1])
    else:
        return (
            (a[p, 0, 0], a[p, 0, 1], a[p, 0, 2]),
            (a[p, 1, 0], a[p, 1, 1], a[p, 1, 2]),
            (a[p, 2, 0], a[p, 2, 1], a[p, 2, 2]),
        )


@kernel
def put_vec(a, p, x):
    """a[p] = x for an (N, d) array."""
    for i in range(len(x)):
        a[p, i] = x[i]


@kernel
def put_mat(a, p, A):
    """a[p] = A for an (N, d, d) array."""
    for i in range(len(A)):
        for j in range(len(A)):
            a[p, i, j] = A[i][j]


@kernel
def fill(s, like):
    """The vector (s, s[, s])."""
    if len(like) == 2:
        return s, s
    else:
        return s, s, s


@kernel
def lin(a, x, b, y):
    """a x + b y of vectors, or of four numbers each."""
    if len(x) == 2:
        return a * x[0] + b * y[0], a * x[1] + b * y[1]
    elif len(x) == 3:
        return a * x[0] + b * y[0], a * x[1] + b * y[1], a * x[2] + b * y[2]
    else:
        return (a * x[0] + b * y[0], a * x[1] + b * y[1], a * x[2] + b * y[2],
                a * x[3] + b * y[3])


@kernel
def mul(x, y):
    """Componentwise product of vectors."""
    if len(x) == 2:
        return x[0] * y[0], x[1] * y[1]
    else:
        return x[0] * y[0], x[1] * y[1], x[2] * y[2]


@kernel
def dot(x, y):
    """x . y."""
    if len(x) == 2:
        return x[0] * y[0] + x[1] * y[1]
    else:
        return x[0] * y[0] + x[1] * y[1] + x[2] * y[2]


@kernel
def total_of(x):
    """Sum of a vector's components."""
    if len(x) == 2:
        return x[0] + x[1]
    else:
        return x[0] + x[1] + x[2]


@kernel
def norm(x):
    """Euclidean length of a vector."""
    return sqrt(dot(x, x))


@kernel
def identity(like):
    """Return the unit matrix."""
    if len(like) == 2:
        return (1.0, 0.0), (0.0, 1.0)
    else:
        return (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)


@kernel
def diag(x):
    """Diagonal matrix of a vector."""
    if len(x) == 2:
        return (x[0], 0.0), (0.0, x[1])
    else:
        return (x[0], 0.0, 0.0), (0.0, x[1], 0.0), (0.0, 0.0, x[2])


@kernel
def diagonal(A):
    """Diagonal of a matrix, as a vector."""
    if len(A) == 2:
        return A[0][0], A[1][1]
    else:
        return A[0][0], A[1][1], A[2][2]


@kernel
def mlin(a, A, b, B):
    """a A + b B of matrices."""
    if len(A) == 2:
        return lin(a, A[0], b, B[0]), lin(a, A[1], b, B[1])
    else:
        return lin(a, A[0], b, B[0]), lin(a, A[1], b, B[1]), lin(a, A[2], b, B[2])


@kernel
def scale(a, A):
    """a A of a matrix."""
    if len(A) == 2:
        (p, q), (r, s) = A
        return (a * p, a * q), (a * r, a * s)
    else:
        x, y, z = A
        return (
            (a * x[0], a * x[1], a * x[2]),
            (a * y[0], a * y[1], a * y[2]),
            (a * z[0], a * z[1], a * z[2]),
        )


@kernel
def plus_diagonal(A, c):
    """A + c I of a matrix."""
    if len(A) == 2:
        return (A[0][0] + c, A[0][1]), (A[1][0], A[1][1] + c)
    else:
        return (
            (A[0][0] + c, A[0][1], A[0][2]),
            (A[1][0], A[1][1] + c, A[1][2]),
            (A[2][0], A[2][1], A[2][2] + c),
        )


@kernel
def outer(x, y):
    """Return x y^T."""
    if len(x) == 2:
        return (x[0] * y[0], x[0] * y[1]), (x[1] * y[0], x[1] * y[1])
    else:
        return (
            (x[0] * y[0], x[0] * y[1], x[0] * y[2]),
            (x[1] * y[0], x[1] * y[1], x[1] * y[2]),
            (x[2] * y[0], x[2] * y[1], x[2] * y[2]),
        )


@kernel
def transpose(A):
    """Return the transpose A^T."""
    if len(A) == 2:
        return (A[0][0], A[1][0]), (A[0][1], A[1][1])
    else:
        return (
            (A[0][0], A[1][0], A[2][0]),
            (A[0][1], A[1][1], A[2][1]),
            (A[0][2], A[1][2], A[2][2]),
        )


@kernel
def mv(A, x):
    """Return A x."""
    if len(x) == 2:
        return dot(A[0], x), dot(A[1], x)
    else:
        return dot(A[0], x), dot(A[1], x), dot(A[2], x)


@kernel
def vm(x, A):
    """x^T A, as a vector."""
    if len(x) == 2:
        return lin(x[0], A[0], x[1], A[1])
    else:
        return lin(1.0, lin(x[0], A[0], x[1], A[1]), x[2], A[2])


@kernel
def mm(A, B):
    """Return A B."""
    if len(A) == 2:
        return vm(A[0], B), vm(A[1], B)
    else:
        return vm(A[0], B), vm(A[1], B), vm(A[2], B)


@kernel
def mmt(A, B):
    """Return A B^T."""
    if len(A) == 2:
        return mv(B, A[0]), mv(B, A[1])
    else:
        return mv(B, A[0]), mv(B, A[1]), mv(B, A[2])


@kernel
def scale_columns(A, s):
    """Return A diag(s)."""
    if len(A) == 2:
        return mul(A[0], s), mul(A[1], s)
    else:
        return mul(A[0], s), mul(A[1], s), mul(A[2], s)


@kernel
def inner(A, B):
    """A : B = sum_ij A_ij B_ij."""
    if len(A) == 2:
        return dot(A[0], B[0]) + dot(A[1], B[1])
    else:
        return dot(A[0], B[0]) + dot(A[1], B[1]) + dot(A[2], B[2])


@kernel
def trace(A):
    """Sum of the diagonal."""
    return total_of(diagonal(A))


@kernel
def cross(a, b):
    """a x b in 3D."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@kernel
def cofactor(A):
    """d det(A) / dA = det(A) A^-T, defined for singular A too."""
    if len(A) == 2:
        return (A[1][1], -A[1][0]), (-A[0][1], A[0][0])
    else:
        return cross(A[1], A[2]), cross(A[2], A[0]), cross(A[0], A[1])


@kernel
def det(A):
    """Return the determinant."""
    if len(A) == 2:
        return A[0][0] * A[1][1] - A[0][1] * A[1][0]
    else:
        return dot(A[0], cross(A[1], A[2]))
