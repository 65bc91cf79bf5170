"""How far latent coordinates lie from those that a map was trained with.

A map has learned nothing beyond its training snapshots, and nothing else in a reduced run tells
that it has left them. Training latents lie on low-dimensional curved sets, one trajectory for each
run, so that neither their box nor an ellipsoid around them says where they are: its middle may be
empty. What does is the distance to the nearest one, over the largest gap that the training set has
itself.

Which gap: that between a run and all others. Latents that follow one another in a run are close
together however coarsely the parameters are sampled, so that any new run would seem far away.

Which distance: the entries of xhat have no common unit. With a `metric`, distance is the motion
that a change of xhat causes, in m; a direction that moves nothing counts for nothing. Without one,
the training latents' own spread is the unit in each direction; then a run that drifts along a
direction that hardly moves a point seems far away.
"""

from typing import NamedTuple

import numpy as np
from scipy.spatial import KDTree

BEYOND = 1.5        # bound of `Extent.beyond`: a run beyond it has left its training data; 1 is as
                    # far as training runs are from each other
POINTS = 64         # of the body, that the metric is a mean over ...
LATENTS = 100       # ... and training latents
THIN = 0.1          # a direction with a smaller share of the largest spread counts as having it


class Extent(NamedTuple):
    """Training latents in a common unit; r latent coordinates."""

    mean: np.ndarray    # (r,) of the training latents
    ruler: np.ndarray   # (r, r): a change y is as long as y @ ruler
    tree: KDTree        # of all training latents, in that unit, from their mean
    gap: float          # largest distance from a latent to the nearest one of another run
    radius: float       # largest distance from a latent to the mean

    def beyond(self, xhat):
        """Distance of xhat (.., r) from the nearest training latent, over the gap; shape (..).

        0 on a training latent; at most 1 inside, as near to a run as runs are to each other; more
        outside; infinite for coordinates that are not finite.
        """
        return self._over(xhat, lambda y: self.tree.query(y)[0]) / self.gap

    def outlying(self, xhat):
        """Distance of xhat (.., r) from the mean, over that of the farthest training latent; shape
        (..). Without a metric, the Mahalanobis distance. It does not see holes: see `beyond`.
        """
        return self._over(xhat, lambda y: np.linalg.norm(y, axis=1)) / self.radius

    def _over(self, xhat, distance):
        """Distances of the finite ones of xhat (.., r), in the common unit; infinity elsewhere."""
        xhat = np.asarray(xhat, dtype=float)
        finite = np.isfinite(xhat).all(axis=-1)
        found = np.full(finite.shape, np.inf)
        found[finite] = distance((xhat[finite] - self.mean) @ self.ruler)
        return found


def extent(xhat, metric=None):
    """`Extent` of training latents xhat (s, k + 1, r) of s runs, or (m, r) of snapshots that form
    no runs; metric (r, r) as of `motion`, or the inverse of their covariance.

    Of a single run, the gap is the largest step. Raises ValueError where latents are not finite or
    all the same.
    """
    xhat = np.asarray(xhat, dtype=float)
    runs = xhat if xhat.ndim == 3 else xhat[:, None]
    flat = runs.reshape(-1, runs.shape[-1])
    if not np.isfinite(flat).all():
        raise ValueError("a training latent is not finite; train again")
    mean = flat.mean(axis=0)
    ruler = ruler_of(flat - mean, metric)
    runs = (runs - mean) @ ruler
    flat = runs.reshape(flat.shape)
    gap, radius = largest_gap(runs), np.linalg.norm(flat, axis=1).max()
    if not gap > 0.0:
        raise ValueError(f"{len(flat)} training latents of {len(runs)} runs, which do not differ: "
                         "expected runs of different parameters")
    return Extent(mean, ruler, KDTree(flat), float(gap), float(radius))


def trained_extent(field, points, xhat):
    """Return the `Extent` of the latent coordinates xhat (s, k + 1, r) that a field was trained
    with, in the metric of `motion` at some of its points: the one distance of every reduced model.
    Raises ValueError where the latents do not differ.
    """
    latents = evenly(np.reshape(xhat, (-1, field.r)), LATENTS)
    return extent(xhat, motion(field, evenly(points, POINTS), latents))


def evenly(a, count):
    """Return at most `count` of the rows of an array, evenly among them."""
    return a[::-(-len(a) // count)]


def motion(map, X, xhat):
    """Metric (r, r) [m^2] in which a change of latent coordinates is as long as the root mean
    square motion of points X (n, d): G^T G with G = dg/dxhat, mean over them and latents (.., r).
    A part of the points and of the training latents is enough.
    """
    total = np.zeros((map.r, map.r))
    latents = np.reshape(xhat, (-1, map.r))
    for y in latents:
        G = map.derivatives(X, y)[2].reshape(-1, map.r)
        total += G.T @ G
    return total / (len(X) * len(latents))


def ruler_of(off, metric):
    """The matrix W with || y W ||^2 = y . metric y; without a metric, with unit spread of the
    latents off (m, r) their mean, where they spread at all.
    """
    if metric is not None:
        square, axes = np.linalg.eigh(metric)
        return axes * np.sqrt(np.maximum(square, 0.0))
    square, axes = np.linalg.eigh(off.T @ off / len(off))
    spread = np.sqrt(np.maximum(square, 0.0))
    if not spread[-1] > 0.0:
        raise ValueError(f"{len(off)} training latents that are all the same: no range is trained")
    return axes / np.maximum(spread, THIN * spread[-1])


def largest_gap(runs):
    """The largest distance from a latent of runs (s, k + 1, r) to the nearest one of another run;
    between successive ones where there is one run.
    """
    if len(runs) == 1:
        return np.linalg.norm(np.diff(runs[0], axis=0), axis=1).max(initial=0.0)
    others = (np.delete(runs, i, axis=0).reshape(-1, runs.shape[2]) for i in range(len(runs)))
    return max(KDTree(other).query(run)[0].max() for run, other in zip(runs, others, strict=True))
