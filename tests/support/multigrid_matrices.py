"""Matrices to try multigrid on: elasticity with quadratic splines on ragged lumps, some held."""

from itertools import product
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp

MU, LAM = 1.0, 1.5
NORMAL = {2: np.array([0.6, 0.8]), 3: np.array([0.36, 0.48, 0.8])}


class Case(NamedTuple):
    A: sp.bsr_array           # B H B
    H: sp.bsr_array           # before the conditions
    index: np.ndarray         # (n, d)
    B: np.ndarray             # (n, d, d)


def points(cells):
    """2^d material points in each of the cells (k, d)."""
    d = cells.shape[1]
    inside = np.array(list(product((0.21, 0.79), repeat=d)))
    return (cells[:, None, :] + inside).reshape(-1, d)


def splines(x):
    """Nodes (N, 3^d, d), weights (N, 3^d) and their gradients (N, 3^d, d) at points x."""
    d = x.shape[1]
    base = np.floor(x - 0.5).astype(int)
    s = x - base
    w = np.stack([0.5 * (1.5 - s) ** 2, 0.75 - (s - 1) ** 2, 0.5 * (s - 0.5) ** 2], axis=1)
    dw = np.stack([s - 1.5, -2 * (s - 1), s - 0.5], axis=1)
    ks = np.array(list(product(range(3), repeat=d)))
    pick = [np.prod([(dw if a == b else w)[:, ks[:, a], a] for a in range(d)], axis=0)
            for b in range(d)]
    value = np.prod([w[:, ks[:, a], a] for a in range(d)], axis=0)
    return base[:, None, :] + ks, value, np.stack(pick, axis=2)


def assembled(x, stiffness):
    """(mass + elasticity of points x with a modulus each, world indices of the nodes)."""
    d = x.shape[1]
    nodes, w, dw = splines(x)
    index, number = np.unique(nodes.reshape(-1, d), axis=0, return_inverse=True)
    number = number.reshape(w.shape)
    N, n = len(x), len(index)
    eye = sp.csr_array(sp.eye_array(d))
    grads = [sp.coo_array((dw[:, :, a].reshape(-1),
                           (np.repeat(np.arange(N), w.shape[1]), number.reshape(-1))), (N, n))
             for a in range(d)]
    # rows of G: component b of the displacement differentiated along a
    G = sp.vstack([sp.kron(g, eye[[b]]) for g in grads for b in range(d)]).tocsr()
    one = np.eye(d).reshape(-1)
    swap = np.eye(d * d).reshape(d, d, d, d).transpose(1, 0, 2, 3).reshape(d * d, d * d)
    C = sp.kron(LAM * np.outer(one, one) + MU * (np.eye(d * d) + swap), sp.diags_array(stiffness))
    mass = np.bincount(number.reshape(-1), w.reshape(-1), n)
    H = G.T @ C @ G + sp.kron(sp.diags_array(mass), eye)
    H = sp.bsr_array(sp.csr_array(0.5 * (H + H.T)), blocksize=(d, d))
    H.sort_indices()
    return H, index


def lump(d, size, filled, rng):
    """Cells of a box around the origin, filled by that much."""
    sides = [range(-size // 2, size - size // 2)] * (d - 1)
    cells = np.array(list(product(*sides, range(-3, size))))
    return cells[rng.random(len(cells)) < filled]


def projectors(index):
    """Held where the last index is low, a slip plane askew where it is highest."""
    n, d = index.shape
    B = np.tile(np.eye(d), (n, 1, 1))
    B[index[:, -1] <= -2] = 0.0
    slip = index[:, -1] >= index[:, -1].max() - 1
    B[slip] = np.eye(d) - np.outer(NORMAL[d], NORMAL[d])
    return B


def conditioned(H, B):
    """B H B in blocks, symmetric to the bit."""
    row = np.repeat(np.arange(len(B)), np.diff(H.indptr))
    A = sp.bsr_array((B[row] @ H.data @ B[H.indices], H.indices, H.indptr), shape=H.shape)
    T = sp.bsr_array(A.T)
    T.sort_indices()
    return sp.bsr_array((0.5 * (A.data + T.data), H.indices, H.indptr), shape=H.shape)


def case(d, size, held=True, contrast=1.0, filled=0.85):
    """A matrix on an irregular lump; the upper half is `contrast` times stiffer than 30 MU."""
    x = points(lump(d, size, filled, np.random.default_rng(0)))
    H, index = assembled(x, 30.0 * np.where(x[:, -1] > 1.0, contrast, 1.0))
    B = projectors(index) if held else np.tile(np.eye(d), (len(index), 1, 1))
    return Case(conditioned(H, B), H, index, B)


def dense(grids, shape):
    """Matrix of the map b -> cycle(b)."""
    unit = np.eye(shape[0] * shape[1])
    return np.stack([grids.cycle(e.reshape(shape)).reshape(-1) for e in unit], axis=1)


def free_basis(B):
    """Orthonormal columns that span the free directions of projectors B (n, d, d)."""
    n, d = B.shape[:2]
    values, vectors = np.linalg.eigh(B)
    full = np.zeros((n, d, n, d))
    full[np.arange(n), :, np.arange(n)] = vectors
    return full.reshape(n * d, n * d)[:, values.reshape(-1) > 0.5]
