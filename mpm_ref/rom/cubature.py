"""Few samples with weights that tell the coordinates of a motion which they do not resolve.

Samples tell latent coordinates by least squares (NSF-eq10). With all points, motions along further
modes of the displacement leave no trace in them, as modes are orthogonal. With few they do, and
step by step the trace becomes a drift. So points p and weights w_p >= 0 are sought with

    sum_p w_p U_kp . U_lp = sum over all points of the same = delta_kl,    k <= r,  l <= R

as [AnKimJames2008] does for forces: one by one, the point first that lessens what is left most, all
weights anew each time by non-negative least squares. Or cell by cell with all points of each: those
that share their nodes ask for the same others around them, so more of them cost a step little.
"""

from typing import NamedTuple

import numpy as np
from scipy.optimize import nnls

from ..core.blas import one_thread

ROUNDS = 25         # in which points are found, about as many in each
CANDIDATES = 1500   # random points that samples are chosen from


class Cubature(NamedTuple):
    """Samples with weights."""

    points: np.ndarray      # (s,) numbers, sorted
    w: np.ndarray           # (s,) > 0, of mean 1
    misfit: float           # || what is left || / || right side ||


def cubature(U, r, among, count, cell=None):
    """`Cubature` of at most `count` of the points `among`, for modes U (n, d, R), orthonormal over
    all points, of which the first r are asked for. There are r R - r (r - 1) / 2 different
    products, and no more points are kept. cell: the number of the cell of each of them, 0 and on;
    then of points in at most `count` cells. Raises ValueError for too few points, RuntimeError
    where the least squares do not end.
    """
    among = np.asarray(among)
    if cell is None and not r <= count * U.shape[1]:
        raise ValueError(f"{count} samples for {r} latent coordinates: expected at least "
                         f"{-(-r // U.shape[1])}")
    A = np.einsum("pdk,pdl->klp", U[among][:, :, :r], U[among]).reshape(-1, len(among))
    b = np.eye(r, U.shape[2]).ravel()
    with one_thread():
        chosen, w = chosen_of(A, b, count, cell)
    points, kept = among[chosen], w > 0.0
    if kept.sum() * U.shape[1] < r:
        more = "do the modes vanish at all of them?" if cell is None else "expected more cells"
        raise ValueError(f"{kept.sum()} points of {len(among)} have a weight, too few for {r} "
                         f"latent coordinates: {more}")
    order = np.argsort(points[kept])
    left = np.linalg.norm(A[:, chosen] @ w - b) / np.linalg.norm(b)
    return Cubature(points[kept][order], (w[kept] / w[kept].mean())[order], float(left))


def misfit(U, r, points):
    """What points of the same weight, the best one, leave of the products: as `Cubature.misfit`,
    between 0 and 1.
    """
    found, wanted = np.einsum("pdk,pdl->kl", U[points][:, :, :r], U[points]), np.eye(r, U.shape[2])
    scale = np.sum(found * wanted) / max(np.sum(found**2), np.finfo(float).tiny)
    return float(np.linalg.norm(scale * found - wanted) / np.linalg.norm(wanted))


def chosen_of(A, b, count, cell=None):
    """Columns of A (m, n), at most `count` or those of so many cells, and their weights >= 0, with
    A w = b as nearly as the search finds.
    """
    parts = np.arange(A.shape[1])[:, None] if cell is None else members(cell)
    length = np.linalg.norm(A, axis=0)
    taken, chosen, w, left = [], np.zeros(0, dtype=int), np.zeros(0), b
    count = min(count, len(parts))
    at_once = -(-count // ROUNDS)
    while len(taken) < count:
        gain = gains(A.T @ left, length, cell)
        gain[taken] = -np.inf
        best = np.argsort(gain)[::-1][:min(at_once, count - len(taken))]
        if gain[best[0]] <= 1e-12 * np.linalg.norm(b):
            break
        taken += best.tolist()
        chosen = np.concatenate([parts[k] for k in taken])
        w, _ = nnls(A[:, chosen], b)
        left = b - A[:, chosen] @ w
    return chosen, w


def gains(along, length, cell):
    """What columns of these lengths (n,), or cells of them, are worth that lie `along` (n,) what is
    left: their component, and of a cell's that of all that are of use, over the length of all.
    """
    if cell is None:
        return along / np.where(length > 0.0, length, np.inf)
    use, whole = (np.bincount(cell, a**2) for a in (np.maximum(along, 0.0), length))
    return np.sqrt(use / np.where(whole > 0.0, whole, np.inf))


def members(cell):
    """Numbers of the columns of each cell."""
    order = np.argsort(cell, kind="stable")
    return np.split(order, np.cumsum(np.bincount(cell))[:-1])
