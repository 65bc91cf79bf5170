"""Restriction and prolongation between levels as sums per node, hence in any number of threads."""

from typing import NamedTuple

import numpy as np
import scipy.sparse as sp

from ....core.jit import CHUNKS, chunk, kernel, parallel, prange
from ....core.tensor import fill, lin, mat, mv, put_vec, vec
from .sparse import SERIAL, dimension_tag


class NodeWeights(NamedTuple):
    """Rows of scalar weights, as in scipy.sparse.csr_array."""

    start: np.ndarray      # (n + 1,)
    column: np.ndarray     # (k,)
    value: np.ndarray      # (k,)


class Transfer(NamedTuple):
    """v_i = B_i sum_c W_ic v_c and its transpose; only partly held nodes need their projector."""

    up: NodeWeights           # of fine nodes
    down: NodeWeights         # of coarse nodes
    partly: np.ndarray        # (k,)       fine nodes held in some directions
    B: np.ndarray             # (k, d, d)  their projectors
    like: np.ndarray          # as in BlockMatrix


def transfer(W, B):
    """Transfer of weights W (n, m), whose rows of wholly held nodes are empty, and projectors B."""
    R = sp.csr_array(W.T)
    unit = (np.eye(B.shape[1]) == B).all(axis=(1, 2))
    partly = np.flatnonzero(~unit & B.any(axis=(1, 2)))
    weights = (NodeWeights(w.indptr, w.indices, w.data) for w in (W, R))
    return Transfer(*weights, partly, B[partly], dimension_tag(B.shape[1]))


@kernel
def _sum(weights, u, out, like, bounds):
    for i in range(bounds[0], bounds[1]):
        s = fill(0.0, like.shape)
        for e in range(weights.start[i], weights.start[i + 1]):
            s = lin(1.0, s, weights.value[e], vec(u, weights.column[e], like.shape))
        put_vec(out, i, s)


@parallel
def _sum_all(weights, u, out, like):
    for c in prange(CHUNKS):
        _sum(weights, u, out, like, chunk(c, len(out)))


@kernel
def _mask(u, partly, B, like):
    for k in range(len(partly)):
        put_vec(u, partly[k], mv(mat(B, k, like.shape), vec(u, partly[k], like.shape)))


def _apply(weights, u, like):
    out = np.empty((len(weights.start) - 1, u.shape[1]))
    if len(out) < SERIAL:
        _sum(weights, u, out, like, (0, len(out)))
    else:
        _sum_all(weights, u, out, like)
    return out


def restrict(t, r):
    """P^T r (m, d) of r (n, d), whose held directions are dropped in place (HOT-eq3)."""
    _mask(r, t.partly, t.B, t.like)
    return _apply(t.down, r, t.like)


def prolong(t, u):
    """P u (n, d) of u (m, d) (HOT-eq4)."""
    v = _apply(t.up, u, t.like)
    _mask(v, t.partly, t.B, t.like)
    return v
