"""The Hessian as a block matrix: sums over the particles of a cell first, then one scatter.

A pair of nodes i, j that a particle reaches gets the block

    H_ij = sum_p sum_bc C_(b)(c) dw_ip,b dw_jp,c,    C_(ab)(cd) = dT_ab / dL_cd    (a row, c column)

All particles of a cell reach the same nodes, so that their blocks are summed up in a small dense
matrix, of which the blocks with j >= i suffice: nodes are numbered in the order of the stencil, and
the matrix is mirrored in the end, which makes it symmetric to the bit. Slabs of cells write to rows
of their own nodes only (see `core.order`).

`pattern_of` finds which blocks there are; `diagonal` computes the diagonal blocks alone, for
methods that do without the matrix.
"""

from typing import NamedTuple

import numpy as np
from scipy.sparse import bsr_array

from ..core.jit import CHUNKS, chunk, kernel, parallel, prange
from ..core.stencil import column, columns, gradient, node, slopes_per_axis, weights_per_axis
from ..core.tensor import (
    mat,
    mlin,
    mm,
    mmt,
    mv,
    outer,
    plus_diagonal,
    put_mat,
    put_vec,
    transpose,
    vec,
)
from ..materials.principal import apply
from .quadrature import pairs_of


class BlockSlots(NamedTuple):
    """Places in the Hessian of the blocks of a cell."""

    data: np.ndarray      # (blocks, d, d)
    block: np.ndarray     # (n, offsets)    as in `Pattern`
    number: np.ndarray    # (n1, .., nd)    number of each node of the box, -1 without mass
    hop: np.ndarray       # (S,)            from a cell's first node to its I-th, in the box
    code: np.ndarray      # (S,)            offset of the I-th node, numbered as in `Pattern`


class CellBlocks(NamedTuple):
    """Workspace of one cell with S = (degree + 1)^d nodes."""

    K: np.ndarray     # (S, S, d, d)    sums of the blocks I, J, for J >= I
    g: np.ndarray     # (S, d)          dw_ip of one particle [1/m]
    C: np.ndarray     # (d d, d, d)     C_(.b)(.c) of one particle at [c d + b]
    T: np.ndarray     # (d, S, d, d)    sum_c C_(.b)(.c) dw_Jp,c at [b, J]


def assembled(bodies, unknowns, pattern, stencil):
    """H = M + the blocks of bodies, pairs of points and `StressModes`, as a bsr_array [kg]."""
    n, d = unknowns.v.shape
    matrix = _empty(unknowns.number, pattern)
    for points, modes in bodies:
        for color in (0, 1):
            _assemble_color(points, modes, stencil, unknowns.dx, matrix, color)
    _complete_all(matrix.data, pattern, unknowns.m, unknowns.number.shape)
    return bsr_array((matrix.data, pattern.indices, pattern.indptr), (n * d, n * d))


def _empty(number, pattern):
    d, degree = number.ndim, pattern.degree
    data = np.zeros((len(pattern.indices), d, d))
    offset = np.indices(d * (degree + 1,)).reshape(d, -1)
    code = strides(d * (2 * degree + 1,)) @ offset
    return BlockSlots(data, pattern.block, number, strides(number.shape) @ offset, code)


@kernel
def assemble(points, modes, stencil, dx, matrix, bounds):
    """Add the blocks with j >= i of the particles bounds[0] .. bounds[1] - 1."""
    like = matrix.number.shape
    cell = empty_cell(len(matrix.hop), len(like))
    for p in range(bounds[0], bounds[1]):
        slopes(points, p, stencil, dx, cell.g, like)
        differential(modes, p, cell.C, like)
        contract(cell, like)
        accumulate(cell, like)
        if p + 1 == bounds[1] or vec(points.base, p, like) != vec(points.base, p + 1, like):
            flush(cell.K, first_node(points.base, p, like), matrix, like)
            clear(cell.K)


@kernel
def empty_cell(S, d):
    """Workspace with K = 0."""
    K = np.zeros((S, S, d, d))
    return CellBlocks(K, np.empty((S, d)), np.empty((d * d, d, d)), np.empty((d, S, d, d)))


@kernel
def slopes(points, p, stencil, dx, g, like):
    """g_I = dw_Ip [1/m]."""
    s = vec(points.s, p, like)
    w, dw = weights_per_axis(s, stencil), slopes_per_axis(s, stencil)
    for c in range(columns(s, stencil)):
        k = column(c, stencil, like)
        for l in range(len(stencil)):
            put_vec(g, c * len(stencil) + l, gradient(k, l, w, dw, dx))


@kernel
def differential(modes, p, C, like):
    """C_(ib)(jc): the stress T_ib of the velocity gradient e_j e_c^T."""
    U, W, A = mat(modes.U, p, like), mat(modes.W, p, like), mat(modes.A, p, like)
    pairs, d = pairs_of(modes.ab, p, like), len(like)
    for j in range(d):
        for c in range(d):
            T = mmt(mm(U, apply(A, pairs, outer(U[j], W[c]))), W)
            for i in range(d):
                for b in range(d):
                    C[c * d + b, i, j] = T[i][b]


@kernel
def contract(cell, like):
    """T_b,J = sum_c C_(.b)(.c) g_J,c."""
    d = len(like)
    for b in range(d):
        C_b = mat(cell.C, b, like), mat(cell.C, d + b, like), mat(cell.C, (d - 1) * d + b, like)
        for J in range(len(cell.g)):
            T_bJ = combined(vec(cell.g, J, like), C_b)
            for i in range(d):
                for j in range(d):
                    cell.T[b, J, i, j] = T_bJ[i][j]


@kernel
def combined(x, A):
    """sum_a x_a A_a of as many matrices as x has components."""
    if len(x) == 2:
        return mlin(x[0], A[0], x[1], A[1])
    else:
        return mlin(1.0, mlin(x[0], A[0], x[1], A[1]), x[2], A[2])


@kernel
def accumulate(cell, like):
    """K_IJ += sum_b g_I,b T_b,J for J >= I. Unsigned indices let the compiler use vectors."""
    S, d = len(cell.g), len(like)
    K, T = cell.K.reshape(S, S * d * d), cell.T.reshape(d, S * d * d)
    for I in range(S):
        g_I = vec(cell.g, I, like)
        for e in range(np.uint64(I * d * d), np.uint64(S * d * d)):
            K[I, e] += combination(g_I, T, e)


@kernel
def combination(x, T, e):
    """sum_b x_b T[b, e]."""
    if len(x) == 2:
        return x[0] * T[0, e] + x[1] * T[1, e]
    else:
        return x[0] * T[0, e] + x[1] * T[1, e] + x[2] * T[2, e]


@kernel
def clear(K):
    """K_IJ = 0 for J >= I."""
    for I in range(len(K)):
        K[I, I:] = 0.0


@kernel
def first_node(base, p, shape):
    """Number of a particle's base node in the box of the given shape, flattened."""
    i = base[p, 0]
    for a in range(1, len(shape)):
        i = i * shape[a] + base[p, a]
    return i


@kernel
def flush(K, first, matrix, like):
    """Add the blocks of a cell to those of the matrix. Nodes without mass have only zeros."""
    number, centre = matrix.number.reshape(-1), matrix.block.shape[1] // 2
    for I in range(len(K)):
        i = number[first + matrix.hop[I]]
        if i >= 0:
            for J in range(I, len(K)):
                k = matrix.block[i, centre + matrix.code[J] - matrix.code[I]]
                if k >= 0:
                    K_IJ = mat(K[I], J, like)
                    put_mat(matrix.data, k, mlin(1.0, mat(matrix.data, k, like), 1.0, K_IJ))


@kernel
def complete(data, pattern, m, like, bounds):
    """H_ij = H_ji^T for j < i, and masses on the diagonal, in the rows from bounds[0] on."""
    last = pattern.block.shape[1] - 1
    for i in range(bounds[0], bounds[1]):
        for o in range(last // 2):
            k = pattern.block[i, o]
            if k >= 0:
                mirrored = pattern.block[pattern.indices[k], last - o]
                put_mat(data, k, transpose(mat(data, mirrored, like)))
        k = pattern.block[i, last // 2]
        put_mat(data, k, from_upper(plus_diagonal(mat(data, k, like), m[i])))


@kernel
def from_upper(A):
    """The symmetric matrix of the upper triangle of A."""
    if len(A) == 2:
        return (A[0][0], A[0][1]), (A[0][1], A[1][1])
    else:
        return ((A[0][0], A[0][1], A[0][2]), (A[0][1], A[1][1], A[1][2]),
                (A[0][2], A[1][2], A[2][2]))


@parallel
def _assemble_color(points, modes, stencil, dx, matrix, color):
    for h in prange((len(points.slab) - color) // 2):
        a = 2 * h + color
        bounds = points.slab[a], points.slab[a + 1]
        if bounds[1] > bounds[0]:
            assemble(points, modes, stencil, dx, matrix, bounds)


@parallel
def _complete_all(data, pattern, m, like):
    for c in prange(CHUNKS):
        complete(data, pattern, m, like, chunk(c, len(m)))


# sparsity: one block for every pair of nodes that a particle can reach


class Pattern(NamedTuple):
    """Block sparsity of n rows; o numbers the (2 q + 1)^d offsets of nodes that share splines of
    degree q, first axis slowest.
    """

    indptr: np.ndarray     # (n + 1,)        first block of each row
    indices: np.ndarray    # (blocks,)       column of each block, ascending in a row
    block: np.ndarray      # (n, offsets)    block of a row and an offset; -1 where there is none
    degree: int

    @property
    def diagonal(self):
        """The block (n,) of each row that is on the diagonal."""
        return self.block[:, self.block.shape[1] // 2]


def pattern_of(number, degree):
    """`Pattern` of the nodes that `number` (n1, .., nd) numbers; it is -1 where there is none."""
    d, width = number.ndim, 2 * degree + 1
    padded = np.pad(number, degree, constant_values=-1)
    node = np.flatnonzero(padded.reshape(-1) >= 0)
    hop = strides(padded.shape) @ (np.indices(d * (width,)).reshape(d, -1) - degree)
    indptr = np.zeros(len(node) + 1, dtype=np.int32)
    _count_blocks_all(padded.reshape(-1), node, hop, indptr)
    np.cumsum(indptr, out=indptr)
    indices = np.empty(indptr[-1], dtype=np.int32)
    block = np.empty((len(node), len(hop)), dtype=np.int32)
    _fill_pattern_all(padded.reshape(-1), node, hop, Pattern(indptr, indices, block, degree))
    return Pattern(indptr, indices, block, degree)


def strides(shape):
    """Numbers of entries from one to the next along each axis of a C-ordered array."""
    return np.concatenate((np.cumprod(shape[:0:-1])[::-1], [1])).astype(np.int64)


@kernel
def count_blocks(number, node, hop, indptr, bounds):
    """indptr[i + 1] = blocks of row i, for the rows bounds[0] .. bounds[1] - 1."""
    for i in range(bounds[0], bounds[1]):
        for o in range(len(hop)):
            if number[node[i] + hop[o]] >= 0:
                indptr[i + 1] += 1


@kernel
def fill_pattern(number, node, hop, pattern, bounds):
    """Columns and block numbers of the rows bounds[0] .. bounds[1] - 1."""
    for i in range(bounds[0], bounds[1]):
        k = pattern.indptr[i]
        for o in range(len(hop)):
            column = number[node[i] + hop[o]]
            pattern.block[i, o] = -1
            if column >= 0:
                pattern.indices[k] = column
                pattern.block[i, o] = k
                k += 1


@parallel
def _count_blocks_all(number, node, hop, indptr):
    for c in prange(CHUNKS):
        count_blocks(number, node, hop, indptr, chunk(c, len(node)))


@parallel
def _fill_pattern_all(number, node, hop, pattern):
    for c in prange(CHUNKS):
        fill_pattern(number, node, hop, pattern, chunk(c, len(node)))


# diagonal blocks without the matrix


def diagonal(bodies, unknowns, stencil):
    """Diagonal blocks (n, d, d) [kg] of the Hessian of bodies, pairs of points and `StressModes`.

        H_ii = m_i I + sum_p h_ip,    h_ip e_b = U Y_b (W^T dw_ip),    Y_b = apply(A, pairs, X_b)

    with X_b = (U^T e_b) (W^T dw_ip)^T: the response of particle p (see `quadrature.StressModes`)
    to node i moving along axis b.
    """
    d = unknowns.number.ndim
    D = unknowns.m[:, None, None] * np.eye(d)
    for points, modes in bodies:
        for color in (0, 1):
            _add_diagonal_color(points, modes, stencil, unknowns, D, color)
    return 0.5 * (D + np.swapaxes(D, 1, 2))


@kernel
def add_diagonal(points, modes, stencil, unknowns, D, bounds):
    """Add the blocks of the particles bounds[0] .. bounds[1] - 1."""
    like = unknowns.number.shape
    for p in range(bounds[0], bounds[1]):
        base, s = vec(points.base, p, like), vec(points.s, p, like)
        w, dw = weights_per_axis(s, stencil), slopes_per_axis(s, stencil)
        U, A, pairs = mat(modes.U, p, like), mat(modes.A, p, like), pairs_of(modes.ab, p, like)
        W_T = transpose(mat(modes.W, p, like))
        for c in range(columns(s, stencil)):
            k = column(c, stencil, like)
            for l in range(len(stencil)):
                i = unknowns.number[node(base, k, l)]
                if i >= 0:
                    h_ip = diagonal_block(U, A, pairs, mv(W_T, gradient(k, l, w, dw, unknowns.dx)))
                    put_mat(D, i, mlin(1.0, mat(D, i, like), 1.0, h_ip))


@kernel
def diagonal_block(U, A, pairs, x):
    """h_ip, for x = W^T dw_ip."""
    if len(x) == 2:
        rows = axis_response(U, A, pairs, U[0], x), axis_response(U, A, pairs, U[1], x)
    else:
        rows = (axis_response(U, A, pairs, U[0], x), axis_response(U, A, pairs, U[1], x),
                axis_response(U, A, pairs, U[2], x))
    return transpose(rows)


@kernel
def axis_response(U, A, pairs, e, x):
    """U apply(A, pairs, e x^T) x."""
    return mv(U, mv(apply(A, pairs, outer(e, x)), x))


@parallel
def _add_diagonal_color(points, modes, stencil, unknowns, D, color):
    for h in prange((len(points.slab) - color) // 2):
        a = 2 * h + color
        add_diagonal(points, modes, stencil, unknowns, D, (points.slab[a], points.slab[a + 1]))
