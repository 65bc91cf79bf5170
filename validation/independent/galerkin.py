"""Multigrid by node embedding as dense matrices (HOT-eq3 to HOT-eq6, HOT-alg2, HOT-smoother).

Coarse node c lies on fine node 2 c and exists where it has a positive weight on a fine node; all
nodes are free. The weights are linear: fine node i takes N_lin(i/2 - c) of coarse node c.

With a smoother u <- u + M (b - A u), M symmetric, and S = I - M A, smoothing from zero, correction
by P V' P^T and smoothing again add up to one formula without a sweep:

    V = 2 M - M A M + S P V' P^T S^T        (HOT-alg2)

The smoother is symmetric Gauss-Seidel, M = (D + U)^-1 D (D + L)^-1 with d x d blocks, in colours:
slabs of nodes along the first axis, the even ones first.
"""

from typing import NamedTuple

import numpy as np

SLAB = 4                    # nodes along the first axis of a slab
HALF = 0.5                  # relative tolerance of the coarsest level (HOT-sec5.3-coarse)


class DenseLevel(NamedTuple):
    """One level of n nodes in d dimensions, and the prolongation from m coarser ones."""

    A: np.ndarray           # (n d, n d)
    index: np.ndarray       # (n, d)        integer places of the nodes, in its own spacing
    P: np.ndarray | None    # (n d, m d)    None on the coarsest level


def embedding(index):
    """Return weights (n, m) of nodes index (n, d), and the indices (m, d) of coarse nodes."""
    axes = [np.arange(low // 2 - 1, high // 2 + 2) for low, high in
            zip(index.min(axis=0), index.max(axis=0), strict=True)]
    coarse = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(axes))
    W = np.maximum(0.0, 1.0 - np.abs(index[:, None] / 2.0 - coarse)).prod(axis=-1)
    used = W.any(axis=0)
    return W[:, used], coarse[used]


def hierarchy(A, index, count):
    """Return `DenseLevel`s, finest first, of a matrix A (n d, n d) and nodes index (n, d)."""
    levels = []
    for _ in range(count - 1):
        W, coarse = embedding(index)
        P = np.kron(W, np.eye(index.shape[1]))
        levels.append(DenseLevel(A, index, P))
        A, index = P.T @ A @ P, coarse
    return [*levels, DenseLevel(A, index, None)]


def gauss_seidel(level):
    """Return M (n d, n d) of one symmetric sweep over a level, in colours, from zero."""
    n, d = level.index.shape
    color = level.index[:, 0] // SLAB % 2
    place = np.repeat(color * n + np.arange(n), d)
    lower = level.A * (place[:, None] >= place)
    diagonal = level.A * (place[:, None] == place)
    return np.linalg.inv(lower.T) @ diagonal @ np.linalg.inv(lower)


def v_cycle(levels, b, coarsest):
    """Return V b of one V-cycle, for b (n d,) or a matrix of columns; coarsest(A, b) ends it."""
    level, *coarser = levels
    if not coarser:
        return coarsest(level.A, b)
    M, I = gauss_seidel(level), np.eye(len(level.A))
    S = I - M @ level.A
    deeper = v_cycle(coarser, level.P.T @ (S.T @ b), coarsest)
    return (2.0 * M - M @ level.A @ M) @ b + S @ (level.P @ deeper)


def krylov(A, b):
    """Return what CG from zero finds for A u = b, preconditioned by the diagonal of A.

    The k-th iterate is the best in the energy norm of A over the k-th Krylov space; the first with
    sqrt(r.D^-1 r) <= HALF sqrt(b.D^-1 b) is taken (HOT-sec5.3-coarse).
    """
    D = np.diag(A)
    basis, u, r = np.zeros((len(b), 0)), np.zeros_like(b), b
    for _ in b:
        if np.sqrt(r @ (r / D)) <= HALF * np.sqrt(b @ (b / D)):
            break
        basis = np.linalg.qr(np.column_stack([basis, r / D]))[0]
        u = basis @ np.linalg.solve(basis.T @ A @ basis, basis.T @ b)
        r = b - A @ u
    return u
