"""Diagonal blocks of the Hessian without the matrix, for methods that do without it.

    H_ii = m_i I + sum_p h_ip,    h_ip e_b = U Y_b (W^T dw_ip),    Y_b = apply(A, pairs, X_b)

with X_b = (U^T e_b) (W^T dw_ip)^T: the response of particle p (see `modes`) to node i moving along
axis b.
"""

import numpy as np

from ..core.jit import kernel, parallel, prange
from ..core.stencil import (
    column,
    columns,
    gradient,
    node,
    slopes_per_axis,
    weights_per_axis,
)
from ..core.tensor import mat, mlin, mv, outer, put_mat, transpose, vec
from ..materials.principal import apply
from .modes import pairs_of


def diagonal(bodies, unknowns, stencil):
    """Blocks (n, d, d) [kg] of bodies, pairs of `Sites` and `Modes`, and of the nodes' masses."""
    d = unknowns.number.ndim
    D = unknowns.m[:, None, None] * np.eye(d)
    for sites, modes in bodies:
        for color in (0, 1):
            _add_color(sites, modes, stencil, unknowns, D, color)
    return 0.5 * (D + np.swapaxes(D, 1, 2))


@kernel
def add(sites, modes, stencil, unknowns, D, bounds):
    """Add the blocks of the particles bounds[0] .. bounds[1] - 1."""
    like = unknowns.number.shape
    for p in range(bounds[0], bounds[1]):
        base, s = vec(sites.base, p, like), vec(sites.s, p, like)
        w, dw = weights_per_axis(s, stencil), slopes_per_axis(s, stencil)
        U, A, pairs = mat(modes.U, p, like), mat(modes.A, p, like), pairs_of(modes.ab, p, like)
        W_T = transpose(mat(modes.W, p, like))
        for c in range(columns(s, stencil)):
            k = column(c, stencil, like)
            for l in range(len(stencil)):
                i = unknowns.number[node(base, k, l)]
                if i >= 0:
                    h_ip = block(U, A, pairs, mv(W_T, gradient(k, l, w, dw, unknowns.dx)))
                    put_mat(D, i, mlin(1.0, mat(D, i, like), 1.0, h_ip))


@kernel
def block(U, A, pairs, x):
    """h_ip, for x = W^T dw_ip."""
    if len(x) == 2:
        rows = moved(U, A, pairs, U[0], x), moved(U, A, pairs, U[1], x)
    else:
        rows = (moved(U, A, pairs, U[0], x), moved(U, A, pairs, U[1], x),
                moved(U, A, pairs, U[2], x))
    return transpose(rows)


@kernel
def moved(U, A, pairs, e, x):
    """U apply(A, pairs, e x^T) x."""
    return mv(U, mv(apply(A, pairs, outer(e, x)), x))


@parallel
def _add_color(sites, modes, stencil, unknowns, D, color):
    for h in prange((len(sites.slab) - color) // 2):
        a = 2 * h + color
        add(sites, modes, stencil, unknowns, D, (sites.slab[a], sites.slab[a + 1]))
