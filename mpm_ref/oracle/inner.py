"""What the kernels of a step compute on the way and do not store: weights and trial deformation."""

import numpy as np

from ..core.deform import growth
from ..core.jit import kernel
from ..core.stencil import column, columns, locate, product, weights_per_axis
from ..core.tensor import mat, mm, put_mat, vec


@kernel
def _weights(x, grid, stencil, base, w):
    d = grid.m.shape
    for p in range(len(x)):
        first, s = locate(vec(x, p, d), grid, stencil)
        per_axis = weights_per_axis(s, stencil)
        for a in range(len(first)):
            base[p, a] = first[a] + grid.origin[a]
        for c in range(columns(s, stencil)):
            k = column(c, stencil, d)
            for l in range(len(stencil)):
                w[p, c * len(stencil) + l] = product(k, l, per_axis)


@kernel
def _trial(F, L, dt, like, out):
    for p in range(len(F)):
        put_mat(out, p, mm(growth(L, p, dt, like), mat(F, p, like)))


def weights(x, grid, stencil):
    """First node (N, d) that each particle at x reaches, and all its weights (N, (degree + 1)^d).

    Nodes are in order, the last axis fastest.
    """
    base = np.empty(x.shape, dtype=np.int64)
    w = np.empty((len(x), len(stencil) ** x.shape[1]))
    _weights(x, grid, stencil, base, w)
    return base, w


def trial(F, L, dt):
    """(I + dt L) F of all particles (N, d, d)."""
    out = np.empty_like(F)
    _trial(F, L, dt, tuple(range(F.shape[1])), out)
    return out
