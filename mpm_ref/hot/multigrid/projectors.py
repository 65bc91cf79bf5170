"""Directions in which a node may move, on every level of a multigrid (HOT-bc).

Conditions are built into the finest matrix: a held direction has zero rows and columns. On a
coarser level a direction is held where it is held on every finer node that hangs on the node; that
is decided from the weights alone, since coarse blocks of a stiff body may lose it in round-off.
"""

import numpy as np
import scipy.sparse as sp

from .embedding import Embedding, embed, embed_onto

NULL = 1e-13      # of the largest eigenvalue; round-off of B H B leaves about 1e-16
REGULAR = 1e-8    # a determinant, of a block of mean eigenvalue 1, that cannot be round-off
TINY = 1e-14      # smallest eigenvalue of a block that is inverted, against its largest


def diagonal_blocks(A):
    """Diagonal blocks (n, d, d) of a bsr_array; zero where a block is not stored."""
    n, d = A.shape[0] // A.blocksize[0], A.blocksize[0]
    row = np.repeat(np.arange(n), np.diff(A.indptr))
    on = np.flatnonzero(row == A.indices)
    D = np.zeros((n, d, d))
    D[row[on]] = A.data[on]
    return D


def checked(D):
    """Return diagonal blocks D (n, d, d) of a matrix. Raises ValueError if one is not finite."""
    if not np.isfinite(D).all():
        raise ValueError("the matrix has a diagonal that is not finite: has the state blown up?")
    return D


def is_regular(D):
    """Return whether symmetric semi-definite blocks D (n, d, d) surely have full rank: the
    product of the eigenvalues, each over their mean, is far above round-off.
    """
    d = D.shape[1]
    mean = np.einsum("iaa->i", D) / d
    return np.linalg.det(D / np.where(mean > 0.0, mean, 1.0)[:, None, None]) > REGULAR


def onto_range(G):
    """Orthogonal projectors (n, d, d) onto the ranges of symmetric semi-definite blocks G."""
    B = np.tile(np.eye(G.shape[1]), (len(G), 1, 1))
    doubtful = ~is_regular(G)
    values, vectors = np.linalg.eigh(G[doubtful])
    kept = values > NULL * np.maximum(values[:, -1:], 0.0)
    columns = vectors * kept[:, None, :]
    partly = ~kept.all(axis=1)
    B[np.flatnonzero(doubtful)[partly]] = (columns @ columns.transpose(0, 2, 1))[partly]
    return B


def coarse_nodes(index, B, kernel):
    """(embedding, projectors) of the next level for nodes index (n, d) with projectors B (n, d, d).

    A coarse projector is that onto the sum of the free directions of the nodes that hang on it.
    Rows of wholly held nodes are empty; coarse nodes that no free direction reaches are gone.
    """
    free = B.any(axis=(1, 2))
    inner = embed(index[free], kernel)
    W = sp.csr_array(inner.W)
    start = np.zeros(len(index) + 1, dtype=W.indptr.dtype)
    start[1:][free] = np.diff(W.indptr)
    W = sp.csr_array((W.data, W.indices, np.cumsum(start, dtype=start.dtype)),
                     shape=(len(index), len(inner.index)))
    d = B.shape[1]
    partly = ~(np.eye(d) == B).all(axis=(1, 2))
    if not partly[free].any():
        return Embedding(W, inner.index), np.tile(np.eye(d), (len(inner.index), 1, 1))
    return Embedding(W, inner.index), onto_range((W.T @ B.reshape(-1, d * d)).reshape(-1, d, d))


def weights_onto(index, B, coarse):
    """Weights (n, m), linear, of nodes index (n, d) with projectors B on given coarse nodes (m, d);
    rows of wholly held nodes are empty.
    """
    free = np.flatnonzero(B.any(axis=(1, 2)))
    W = sp.coo_array(embed_onto(index[free], coarse))
    return sp.csr_array(sp.coo_array((W.data, (free[W.row], W.col)), (len(index), len(coarse))))


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
