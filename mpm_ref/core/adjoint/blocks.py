"""Matrices of the particles of a block side by side, so that loops over particles use vectors.

A matrix is a flat array of nine rows of BLOCK numbers: entry e = 3 i + j of particle k is number
k + e BLOCK. A vector has three rows, a number one. Each function loops over the first n particles,
and writes its last array alone; offsets are constants, for which the compiler can tell rows apart.
"""

from ..corotated import BLOCK
from ..jit import kernel

_1, _2, _3, _4, _5, _6, _7, _8, _9 = (BLOCK * e for e in range(1, 10))


@kernel
def put_entries(A, k, C):
    """Store the matrix A, a tuple, as that of particle k."""
    C[k], C[k + _1], C[k + _2] = A[0]
    C[k + _3], C[k + _4], C[k + _5] = A[1]
    C[k + _6], C[k + _7], C[k + _8] = A[2]


@kernel
def entries(A, k):
    """The matrix of particle k as a tuple."""
    return (A[k], A[k + _1], A[k + _2]), (A[k + _3], A[k + _4], A[k + _5]), \
        (A[k + _6], A[k + _7], A[k + _8])


@kernel
def products(A, B, C, n):
    """C = A B."""
    for k in range(n):
        b0, b1, b2, b3, b4 = B[k], B[k + _1], B[k + _2], B[k + _3], B[k + _4]
        b5, b6, b7, b8 = B[k + _5], B[k + _6], B[k + _7], B[k + _8]
        for i in range(0, _9, _3):
            x, y, z = A[k + i], A[k + i + _1], A[k + i + _2]
            C[k + i] = x * b0 + y * b3 + z * b6
            C[k + i + _1] = x * b1 + y * b4 + z * b7
            C[k + i + _2] = x * b2 + y * b5 + z * b8


@kernel
def products_transposed(A, B, C, n):
    """C = A B^T."""
    for k in range(n):
        b0, b1, b2, b3, b4 = B[k], B[k + _1], B[k + _2], B[k + _3], B[k + _4]
        b5, b6, b7, b8 = B[k + _5], B[k + _6], B[k + _7], B[k + _8]
        for i in range(0, _9, _3):
            x, y, z = A[k + i], A[k + i + _1], A[k + i + _2]
            C[k + i] = x * b0 + y * b1 + z * b2
            C[k + i + _1] = x * b3 + y * b4 + z * b5
            C[k + i + _2] = x * b6 + y * b7 + z * b8


@kernel
def combinations(factors, matrices, D, n):
    """D = a A + b B + c C of three matrices, with vectors of factors."""
    A, B, C = matrices
    for k in range(n):
        a, b, c = factors[k], factors[k + _1], factors[k + _2]
        for e in range(0, _9, BLOCK):
            D[k + e] = a * A[k + e] + b * B[k + e] + c * C[k + e]


@kernel
def cofactors(A, C, n):
    """C = cof A."""
    for k in range(n):
        a0, a1, a2, a3, a4 = A[k], A[k + _1], A[k + _2], A[k + _3], A[k + _4]
        a5, a6, a7, a8 = A[k + _5], A[k + _6], A[k + _7], A[k + _8]
        C[k], C[k + _1], C[k + _2] = a4 * a8 - a5 * a7, a5 * a6 - a3 * a8, a3 * a7 - a4 * a6
        C[k + _3], C[k + _4] = a2 * a7 - a1 * a8, a0 * a8 - a2 * a6
        C[k + _5], C[k + _6] = a1 * a6 - a0 * a7, a1 * a5 - a2 * a4
        C[k + _7], C[k + _8] = a2 * a3 - a0 * a5, a0 * a4 - a1 * a3


@kernel
def add_symmetrized(S, D, n):
    """D = D + S + S^T."""
    for k in range(n):
        xy, xz, yz = S[k + _1] + S[k + _3], S[k + _2] + S[k + _6], S[k + _5] + S[k + _7]
        D[k] += 2.0 * S[k]
        D[k + _4] += 2.0 * S[k + _4]
        D[k + _8] += 2.0 * S[k + _8]
        D[k + _1], D[k + _2], D[k + _5] = D[k + _1] + xy, D[k + _2] + xz, D[k + _5] + yz
        D[k + _3], D[k + _6], D[k + _7] = D[k + _3] + xy, D[k + _6] + xz, D[k + _7] + yz


@kernel
def symmetrize(A, n):
    """A = (A + A^T)/2."""
    for k in range(n):
        A[k + _1] = A[k + _3] = 0.5 * A[k + _1] + 0.5 * A[k + _3]
        A[k + _2] = A[k + _6] = 0.5 * A[k + _2] + 0.5 * A[k + _6]
        A[k + _5] = A[k + _7] = 0.5 * A[k + _5] + 0.5 * A[k + _7]


@kernel
def inner_products(A, B, s, n):
    """s = A : B."""
    for k in range(n):
        total = 0.0
        for e in range(0, _9, BLOCK):
            total += A[k + e] * B[k + e]
        s[k] = total


@kernel
def determinants(A, K, s, n):
    """s = det A, with K = cof A."""
    for k in range(n):
        s[k] = A[k] * K[k] + A[k + _1] * K[k + _1] + A[k + _2] * K[k + _2]


@kernel
def traces(A, s, n):
    """s = tr A."""
    for k in range(n):
        s[k] = A[k] + A[k + _4] + A[k + _8]


@kernel
def traces_less(A, C, n):
    """C = (tr A) I - A."""
    for k in range(n):
        trace = A[k] + A[k + _4] + A[k + _8]
        for e in range(0, _9, BLOCK):
            C[k + e] = -A[k + e]
        C[k], C[k + _4], C[k + _8] = trace - A[k], trace - A[k + _4], trace - A[k + _8]


@kernel
def axial_vectors(A, x, n):
    """x of A - A^T."""
    for k in range(n):
        x[k], x[k + _1] = A[k + _7] - A[k + _5], A[k + _2] - A[k + _6]
        x[k + _2] = A[k + _3] - A[k + _1]


@kernel
def plus_skew(A, x, C, n):
    """C = A + Z of the skew matrices Z with the axial vectors x."""
    for k in range(n):
        x0, x1, x2 = x[k], x[k + _1], x[k + _2]
        C[k], C[k + _1], C[k + _2] = A[k], A[k + _1] - x2, A[k + _2] + x1
        C[k + _3], C[k + _4], C[k + _5] = A[k + _3] + x2, A[k + _4], A[k + _5] - x0
        C[k + _6], C[k + _7], C[k + _8] = A[k + _6] - x1, A[k + _7] + x0, A[k + _8]


@kernel
def solve(A, K, x, n):
    """x becomes A^-1 x, with K = cof A of a symmetric A."""
    for k in range(n):
        det = A[k] * K[k] + A[k + _1] * K[k + _1] + A[k + _2] * K[k + _2]
        x0, x1, x2 = x[k] / det, x[k + _1] / det, x[k + _2] / det
        x[k] = K[k] * x0 + K[k + _1] * x1 + K[k + _2] * x2
        x[k + _1] = K[k + _3] * x0 + K[k + _4] * x1 + K[k + _5] * x2
        x[k + _2] = K[k + _6] * x0 + K[k + _7] * x1 + K[k + _8] * x2
