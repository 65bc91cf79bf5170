"""Weighted samples that project a motion on latent coordinates as all points of the body would.

Latent coordinates are fitted to the samples by least squares (NSF-eq10). With all points as
samples, motions along further modes of the displacement do not change them, as modes are
orthogonal. With few samples they do, and over many steps the error becomes a drift. So points p
and weights w_p >= 0 are sought for which the modes stay orthogonal,

    sum_p w_p U_kp . U_lp = sum over all points p of U_kp . U_lp = delta_kl,    k <= r,  l <= R

as [AnKimJames2008] does for forces: a greedy search adds the points that reduce the residual most,
and computes all weights anew by non-negative least squares. It can add all points of a cell at a
time: as they share their nodes, they need the same integration points around them, and cost a step
little more than one of them.
"""

from typing import NamedTuple

import numpy as np
from scipy.optimize import nnls

from ..core.blas import one_thread

ROUNDS = 25         # of the search, which adds about as many points in each
CANDIDATES = 1500   # random points that samples are chosen from


class Cubature(NamedTuple):
    """Samples with weights."""

    points: np.ndarray      # (s,) numbers, sorted
    w: np.ndarray           # (s,) > 0, of mean 1
    misfit: float           # || residual || / || right side ||


def cubature(U, r, candidates, count, cell=None):
    """Return the `Cubature` of at most `count` of the points `candidates`.

    U (n, d, R): modes, orthonormal over all points; r: number of the first ones, which are the
    latent coordinates. There are r R - r (r - 1) / 2 different products, and no more points get a
    weight. cell: for every candidate the number of its cell, from 0; then the points are those of
    at most `count` cells. Raises ValueError for too few points, RuntimeError where the least
    squares do not end.
    """
    candidates = np.asarray(candidates)
    if cell is None and not r <= count * U.shape[1]:
        raise ValueError(f"{count} samples for {r} latent coordinates: expected at least "
                         f"{-(-r // U.shape[1])}")
    V = U[candidates].astype(float, copy=False)
    A = np.einsum("pdk,pdl->klp", V[:, :, :r], V).reshape(-1, len(V))
    b = np.eye(r, U.shape[2]).ravel()
    with one_thread():
        chosen, w = select_columns(A, b, count, cell)
    points, used = candidates[chosen], w > 0.0
    if used.sum() * U.shape[1] < r:
        more = "do the modes vanish at all of them?" if cell is None else "expected more cells"
        raise ValueError(f"{used.sum()} points of {len(candidates)} have a weight, too few for {r} "
                         f"latent coordinates: {more}")
    order = np.argsort(points[used])
    residual = np.linalg.norm(A[:, chosen] @ w - b) / np.linalg.norm(b)
    return Cubature(points[used][order], (w[used] / w[used].mean())[order], float(residual))


def misfit(U, r, points):
    """Return the `Cubature.misfit` of points that all have the best common weight; 0 .. 1."""
    V = U[points].astype(float, copy=False)
    products = np.einsum("pdk,pdl->kl", V[:, :, :r], V)
    wanted = np.eye(r, U.shape[2])
    scale = np.sum(products * wanted) / max(np.sum(products**2), np.finfo(float).tiny)
    return float(np.linalg.norm(scale * products - wanted) / np.linalg.norm(wanted))


def select_columns(A, b, count, cell=None):
    """Return numbers of columns of A (m, n) and their weights w >= 0, from a greedy search for the
    least || A w - b ||: at most `count` columns, or all columns of at most `count` cells.
    """
    parts = np.arange(A.shape[1])[:, None] if cell is None else columns_by_cell(cell)
    length = np.linalg.norm(A, axis=0)
    taken, chosen, w, residual = [], np.zeros(0, dtype=int), np.zeros(0), b
    count = min(count, len(parts))
    per_round = -(-count // ROUNDS)
    while len(taken) < count:
        gain = gains(A.T @ residual, length, cell)
        gain[taken] = -np.inf
        best = np.argsort(gain)[::-1][:min(per_round, count - len(taken))]
        if gain[best[0]] <= 1e-12 * np.linalg.norm(b):
            break
        taken += best.tolist()
        chosen = np.concatenate([parts[k] for k in taken])
        w, _ = nnls(A[:, chosen], b)
        residual = b - A[:, chosen] @ w
    return chosen, w


def gains(products, length, cell):
    """Return how well each column, or each cell of columns, points along the residual.

    products (n,): those of the columns with the residual; length (n,): that of each column. A
    column's gain is its component along the residual. A cell's is the norm of the components of
    those columns that point along it, over the norm of all its columns.
    """
    if cell is None:
        return products / np.where(length > 0.0, length, np.inf)
    useful, total = (np.bincount(cell, a**2) for a in (np.maximum(products, 0.0), length))
    return np.sqrt(useful / np.where(total > 0.0, total, np.inf))


def columns_by_cell(cell):
    """Return the numbers of the columns of each cell."""
    order = np.argsort(cell, kind="stable")
    return np.split(order, np.cumsum(np.bincount(cell))[:-1])
