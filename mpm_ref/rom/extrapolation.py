"""Distance of latent coordinates from those that a map was trained with.

A map is trained on its snapshots alone, and nothing else in a reduced run shows that the run has
left them. Training latents lie on low-dimensional curved sets, one trajectory for each run, so that
neither a box nor an ellipsoid around them describes them: its middle may be empty. The distance to
the nearest training latent does, over the largest gap within the training set.

The gap is that between a run and all others. Successive latents of one run are close together
however coarsely the parameters are sampled; measured by their distance, any new run would seem far
away.

The entries of xhat have no common unit. With a `metric`, distance is the motion in m that a change
of xhat causes; a direction that moves nothing counts for nothing. Without one, the spread of the
training latents is the unit in each direction; then a run that drifts along a direction that hardly
moves a point seems far away.
"""

from typing import NamedTuple

import numpy as np
from scipy.spatial import KDTree

BEYOND = 1.5        # bound of `Extent.beyond`: farther out, a run has left its training data; 1 is
                    # the distance of training runs from each other
POINTS = 64         # points of the body in the mean of the metric, at most ...
LATENTS = 100       # ... and training latents
THIN = 0.1          # least spread of a direction, over the largest spread
AHEAD = 0.5         # of a training run: so much later `Paths` compares where states go


class Extent(NamedTuple):
    """Training latents in a common unit; r latent coordinates."""

    mean: np.ndarray    # (r,) of the training latents
    ruler: np.ndarray   # (r, r): the length of a change y is || y @ ruler ||
    tree: KDTree        # of all training latents, in that unit, from their mean
    gap: float          # largest distance from a latent to the nearest one of another run
    radius: float       # largest distance from a latent to the mean

    def beyond(self, xhat):
        """Return the distance (..) of xhat (.., r) from the nearest training latent, over the gap.

        It is 0 on a training latent, at most 1 between training runs, larger outside, and infinite
        for coordinates that are not finite.
        """
        return self._over(xhat, lambda y: self.tree.query(y)[0]) / self.gap

    def outlying(self, xhat):
        """Return the distance (..) of xhat (.., r) from the mean, over that of the farthest
        training latent; without a metric the Mahalanobis distance. It ignores holes, unlike
        `beyond`.
        """
        return self._over(xhat, lambda y: np.linalg.norm(y, axis=1)) / self.radius

    def _over(self, xhat, distance):
        """Return the distances (..) of xhat (.., r) in the common unit; infinity if not finite."""
        xhat = np.asarray(xhat, dtype=float)
        finite = np.isfinite(xhat).all(axis=-1)
        result = np.full(finite.shape, np.inf)
        result[finite] = distance((xhat[finite] - self.mean) @ self.ruler)
        return result


class Paths(NamedTuple):
    """Training latents with the steps that led to them."""

    extent: Extent
    tree: KDTree        # of latents, and of their steps `ahead` times over, in the extent's unit
    ahead: float        # steps of a run

    def distance(self, before, xhat):
        """Return the distance of a step from latent coordinates `before` (r,) to xhat (r,), from
        the nearest one of the training runs, over the gap.

        It compares where the states are, and where they go from there in `ahead` steps at the same
        rate. So it is large, unlike `Extent.beyond`, for a run that is among the trained states and
        moves otherwise; and infinite for coordinates that are not finite.
        """
        if not (np.isfinite(before).all() and np.isfinite(xhat).all()):
            return np.inf
        place, start = ((y - self.extent.mean) @ self.extent.ruler for y in (xhat, before))
        return float(self.tree.query(np.concatenate([place, self.ahead * (place - start)]))[0]
                     / self.extent.gap)


def trained_paths(inside, xhat, spacing=1.0):
    """Return the `Paths` of training latents xhat (s, k + 1, r) of an `Extent`, with the number of
    a run's steps between two of them, `spacing`; None where they form no runs.
    """
    if np.ndim(xhat) != 3 or xhat.shape[1] < 2:
        return None
    places = (xhat - inside.mean) @ inside.ruler
    steps = np.diff(places, axis=1) / spacing
    ahead = AHEAD * steps.shape[1] * spacing
    pairs = np.concatenate([places[:, 1:], ahead * steps], axis=-1)
    return Paths(inside, KDTree(pairs.reshape(-1, pairs.shape[-1])), ahead)


def extent(xhat, metric=None):
    """Return the `Extent` of training latents xhat.

    xhat (s, k + 1, r): those of s runs, or (m, r): of snapshots that form no runs; metric (r, r):
    see `motion_metric`, by default the inverse of the latents' covariance. The gap of a single run
    is its largest step. Raises ValueError where latents are not finite or
    all the same.
    """
    xhat = np.asarray(xhat, dtype=float)
    runs = xhat if xhat.ndim == 3 else xhat[:, None]
    flat = runs.reshape(-1, runs.shape[-1])
    if not np.isfinite(flat).all():
        raise ValueError("a training latent is not finite; train again")
    mean = flat.mean(axis=0)
    ruler = unit_matrix(flat - mean, metric)
    runs = (runs - mean) @ ruler
    flat = runs.reshape(flat.shape)
    gap, radius = largest_gap(runs), np.linalg.norm(flat, axis=1).max()
    if not gap > 0.0:
        raise ValueError(f"{len(flat)} training latents of {len(runs)} runs, which do not differ: "
                         "expected runs of different parameters")
    return Extent(mean, ruler, KDTree(flat), float(gap), float(radius))


def trained_extent(field, points, xhat):
    """Return the `Extent` of the latent coordinates xhat (s, k + 1, r) that a field was trained
    with, in the metric of `motion_metric` at some of its points. Raises ValueError where the
    latents do not differ.
    """
    latents = evenly(np.reshape(xhat, (-1, field.r)), LATENTS)
    return extent(xhat, motion_metric(field, evenly(points, POINTS), latents))


def evenly(a, count):
    """Return at most `count` of the rows of an array, evenly among them."""
    return a[::-(-len(a) // count)]


def motion_metric(field, X, xhat):
    """Return the metric (r, r) [m^2] in which the length of a change of latent coordinates is the
    root mean square motion of points X (n, d) that it causes.

    It is the mean of G^T G, with G = dg/dxhat, over the points and latents xhat (.., r).
    """
    total = np.zeros((field.r, field.r))
    latents = np.reshape(xhat, (-1, field.r))
    for y in latents:
        G = field.derivatives(X, y)[2].reshape(-1, field.r)
        total += G.T @ G
    return total / (len(X) * len(latents))


def unit_matrix(deviations, metric):
    """Return the matrix W (r, r) with || y W ||^2 = y . metric y; without a metric, the one that
    gives the latents' deviations (m, r) from their mean a unit spread, where they spread at all.
    """
    if metric is not None:
        square, axes = np.linalg.eigh(metric)
        return axes * np.sqrt(np.maximum(square, 0.0))
    square, axes = np.linalg.eigh(deviations.T @ deviations / len(deviations))
    spread = np.sqrt(np.maximum(square, 0.0))
    if not spread[-1] > 0.0:
        raise ValueError(f"{len(deviations)} training latents that are all the same: expected "
                         "runs of different parameters")
    return axes / np.maximum(spread, THIN * spread[-1])


def largest_gap(runs):
    """Return the largest distance from a latent of runs (s, k + 1, r) to the nearest one of another
    run; of a single run, that between successive latents.
    """
    if len(runs) == 1:
        return np.linalg.norm(np.diff(runs[0], axis=0), axis=1).max(initial=0.0)
    others = (np.delete(runs, i, axis=0).reshape(-1, runs.shape[2]) for i in range(len(runs)))
    return max(KDTree(other).query(run)[0].max() for run, other in zip(runs, others, strict=True))
