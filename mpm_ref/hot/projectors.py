"""Directions in which a node may move, on every level of a multigrid (HOT-bc).

Conditions are built into the finest matrix: a held direction has zero rows and columns. On a
coarser level a direction is held where it is held on every finer node that hangs on the node; that
is decided from the weights alone, since coarse blocks of a stiff body may lose it in round-off.
"""

import numpy as np
import scipy.sparse as sp

NULL = 1e-13      # of the largest eigenvalue; round-off of B H B leaves about 1e-16
TINY = 1e-14      # smallest eigenvalue of a block that is inverted, against its largest


def diagonal_blocks(A):
    """Diagonal blocks (n, d, d) of a bsr_array; zero where a block is not stored."""
    n, d = A.shape[0] // A.blocksize[0], A.blocksize[0]
    row = np.repeat(np.arange(n), np.diff(A.indptr))
    on = np.flatnonzero(row == A.indices)
    D = np.zeros((n, d, d))
    D[row[on]] = A.data[on]
    return D


def onto_range(G):
    """Orthogonal projectors (n, d, d) onto the ranges of symmetric semi-definite blocks G."""
    values, vectors = np.linalg.eigh(G)
    kept = values > NULL * np.maximum(values[:, -1:], 0.0)
    columns = vectors * kept[:, None, :]
    free = kept.all(axis=1)[:, None, None]
    return np.where(free, np.eye(G.shape[1]), columns @ columns.transpose(0, 2, 1))


def coarser(W, B):
    """Projectors of coarse nodes: onto the sum of the free directions of the nodes hanging on
    them. W (n, m) weights, B (n, d, d) projectors; a coarse node of held ones alone gets zero.
    """
    d = B.shape[1]
    return onto_range((W.T @ B.reshape(-1, d * d)).reshape(-1, d, d))


def inverses(D, B):
    """Pseudo-inverses (n, d, d) of symmetric blocks D on the ranges of their projectors B."""
    d = D.shape[1]
    scale = np.trace(D, axis1=1, axis2=2)[:, None, None]
    held = np.eye(d) - B
    scaled = B @ D @ B / np.where(scale > 0.0, scale, 1.0) + held
    values, vectors = np.linalg.eigh(scaled)
    values = np.maximum(values, TINY * values[:, -1:])
    inverse = (vectors / values[:, None, :]) @ vectors.transpose(0, 2, 1)
    return np.where(scale > 0.0, B @ inverse @ B / np.where(scale > 0.0, scale, 1.0), 0.0)


def block_diagonal(blocks):
    """bsr_array with the given diagonal blocks (n, d, d)."""
    n, d = blocks.shape[:2]
    number = np.arange(n + 1, dtype=np.int32)
    return sp.bsr_array((blocks, number[:-1], number), shape=(n * d, n * d))
