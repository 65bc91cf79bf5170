"""F-bar: the growth of volume in a step is averaged over cells [deSouzaNeto1996] [Coombs2018].

    G_p = I + dt L_p
    J_c = sum_p w_cp V0_p det G_p / sum_p w_cp V0_p
    J_p = sum_c w_cp J_c
    I + dt Lbar_p = (J_p/det G_p)^(1/d) G_p

c is a cell between 2^d nodes, and w_cp the mean of their linear splines at x_p.
"""

import numpy as np

from .spline import bspline
from .tensors import det


def averaged(motion, V0, dx, dt):
    """Return Lbar (N, d, d) [1/s], the velocity gradient of a step of dt [s] with averaged volumes.

    motion has the new positions x (N, d) [m] and L (N, d, d) [1/s]; V0 (N,) [m^d]; dx [m].
    """
    x, L = motion.x, motion.L
    d = x.shape[1]
    G = np.eye(d, dtype=L.dtype) + dt * L
    w, cell = cell_weights(x / dx)
    mean = mean_over_cells(det(G), V0, w, cell)
    ratio = np.where(mean / det(G) > 0, mean / det(G), 1) ** (L.dtype.type(1) / d)
    return (ratio[:, None, None] * G - np.eye(d, dtype=L.dtype)) / dt


def cell_weights(s):
    """Return w_cp (N, 3^d) of points at s (N, d) [cells], and the integer coordinates (N, 3^d, d)
    of the cells' first nodes.
    """
    d = s.shape[1]
    cell = np.floor(s).astype(int)[:, None] - 1 + np.array(list(np.ndindex(*d * (3,))))
    u = s[:, None] - cell.astype(s.dtype)
    w = (bspline(u + 1, 1) + bspline(u, 1)) / 2
    return w.prod(axis=-1), cell


def mean_over_cells(a, V0, w, cell):
    """Return sum_c w_cp a_c (N,), with the mean a_c = sum_p w_cp V0_p a_p / sum_p w_cp V0_p."""
    _, c = np.unique(cell.reshape(-1, cell.shape[-1]), axis=0, return_inverse=True)
    c = c.reshape(w.shape)
    V, Va = np.zeros(c.max() + 1, a.dtype), np.zeros(c.max() + 1, a.dtype)
    np.add.at(V, c, w * V0[:, None])
    np.add.at(Va, c, w * (V0 * a)[:, None])
    return (w * (Va / np.where(V > 0, V, 1))[c]).sum(axis=1)
