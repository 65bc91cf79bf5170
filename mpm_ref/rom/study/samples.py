"""Samples of a reduced run: which points, from when on, and with which weights.

LDM draws them for each step anew, or once (`ldm_sampler`); NSF keeps them, or exchanges the set at
times (`nsf_sampler`), with weights by cubature if asked for.
"""

from math import ceil
from typing import NamedTuple

import numpy as np

from ..cubature import CANDIDATES, cubature
from ..fields.pod_fields import PodFields
from ..prescribed import prescribed_share, weights_by_share
from ..quadrature.stencil_overlap import bases
from ..sampling import PER_GROUP, draw, pivoted
from .full_model import prescribed_regions

ENOUGH = 4000       # points from which the start is searched, and among which samples are pivoted
MAX_CELLS = 400     # cells of this many random points are candidates


class SampleSet(NamedTuple):
    """Samples of a step."""

    since: float                        # time from which they are used [s]
    points: np.ndarray                  # numbers, sorted
    weights: np.ndarray | None = None   # None: all count the same
    misfit: float = np.nan              # of the weights (see `rom.cubature`)


# LDM.

def ldm_sampler(full, g, options, xhat, seed):
    """Return the function (time [s], `Latent`) -> `SampleSet` of the step that begins there, for
    LDM's run of a `FullModel` on a map g with `RunOptions`. Raises ValueError for `samples` that do
    not exist, and as `random_draw` does.
    """
    rng = np.random.default_rng(seed)

    def weighted(since, points, when):
        return SampleSet(since, points, driven_weights(full, g, options, points, when))

    if options.samples == "redrawn":
        return lambda t, latent: weighted(t, random_draw(full, g, options, t)(rng), (t, latent))
    if options.samples == "kept":
        points = random_draw(full, g, options)(rng)
    elif options.samples == "pivoted":
        points = pivoted_samples(full.map_points, random_draw(full, g, options),
                                 lambda X: g.derivatives(X, xhat)[2], rng)
    else:
        raise ValueError(f"samples = {options.samples!r}: expected redrawn, kept or pivoted")
    return lambda t, latent: weighted(0.0, points, (t, latent))


def require_prescribed_region(full, options):
    """Raise ValueError for a `driven_weight` of a `FullModel` without prescribed regions."""
    if options.driven_weight != 1.0 and not prescribed_regions(full.problem):
        raise ValueError(f"driven_weight = {options.driven_weight:g}: expected 1, since the scene "
                         "prescribes no velocity; add a [[fixed]] region, or leave it out")


def driven_weights(full, g, options, points, when):
    """Return the weights (m,) of samples by the share of their velocity that is prescribed (see
    `rom.prescribed`), in the step that begins when = (time [s], `Latent`); None where all count the
    same.
    """
    if options.driven_weight == 1.0:
        return None
    t, latent = when
    phi = prescribed_share(full.problem, g.place(full.map_points[points], latent.xhat), t)
    return weights_by_share(phi, options.driven_weight) if phi.any() else None


def random_draw(full, g, options, t=0.0):
    """Return the `Draw` of the samples of the step that begins at t [s]. Raises ValueError where
    they do not suffice, and for more pivoted ones than there are candidates.
    """
    n = len(full.X)
    count = options.points or n
    if options.samples == "pivoted" and count > ENOUGH:
        raise ValueError(f"{count} samples that are pivoted: expected at most {ENOUGH}; take fewer "
                         'points, or samples = "kept"')
    return draw(n, count, g.r, g.dim, boundary_groups(full, options, t))


def pivoted_samples(X, draw, G, rng):
    """Return the sorted numbers of the samples of a `Draw` from points X (n, ..): those of its
    groups at random, the others pivoted by dg/dxhat, G(X).
    """
    forced = np.unique(np.concatenate([np.empty(0, dtype=int), *(
        rng.choice(group, min(draw.per_group, len(group)), replace=False)
        for group in draw.groups)]))
    candidates = np.setdiff1d(rng.choice(draw.n, min(draw.n, ENOUGH), replace=False), forced)
    best = candidates[pivoted(G(X[candidates]), draw.count - len(forced))]
    return np.union1d(best, forced)


def boundary_groups(full, options, t):
    """Return the groups of points that samples must not miss, also each of several bodies: none
    where all points are samples, or where these groups would be more than half of them, since fixed
    points say little of the body's motion.
    """
    groups = full.constrained_points(t) + full.body_points
    return groups if options.points and options.points >= 2 * PER_GROUP * len(groups) else ()


# NSF.

def nsf_sampler(sets):
    """Return the function (time [s], `Latent`) -> `SampleSet` of the step that begins there, from
    sets in order of time (NSF-sec5.4).
    """
    return lambda t, latent: [one for one in sets if one.since <= t][-1]


def chosen_samples(run, problem, fields):
    """Return the `SampleSet` that the [run] table of a study asks for. Raises ValueError as
    `require_enough_samples` does, and for weights of samples without modes.
    """
    n = len(fields.X)
    count = n if run.points is None else run.points
    require_enough_samples(run, fields.X, fields.r)
    if not (run.weighted or run.cells):
        return drawn_samples(n, count, run.seed)
    if not isinstance(fields, PodFields):
        asked = "weighted = true" if run.weighted else f"cells = {run.cells}"
        raise ValueError(f"{asked}: weights of samples are computed from modes, which networks "
                         "have not; leave it out, or make fields of modes")
    if run.weighted:
        return weighted_samples(fields, n, count, run.seed)
    return cell_samples(fields, problem, n, run.cells, run.seed)


def require_enough_samples(run, X, r):
    """Raise ValueError where the samples that the [run] table asks for, of points X (n, d), do not
    suffice for r latent coordinates, or are more than there are points.
    """
    (n, d), count = X.shape, run.points
    if count is not None and not ceil(r / d) <= count <= n:
        raise ValueError(f"points = {count}: expected {ceil(r / d)} .. {n} samples, of {n} points "
                         f"and for {r} latent coordinates; change `points` of [run]")


def drawn_samples(candidates, count, seed, since=0.0):
    """Return the `SampleSet` of `count` random points (NSF-sec5.4). candidates: their number, or
    the numbers of those to draw from. Raises ValueError where there are too few.
    """
    numbers = numbers_of(candidates)
    if not 1 <= count <= len(numbers):
        raise ValueError(f"{count} samples of {len(numbers)} points: expected 1 .. {len(numbers)}")
    points = np.random.default_rng(seed).choice(numbers, count, replace=False)
    return SampleSet(since, np.sort(points))


def weighted_samples(fields, candidates, count, seed, since=0.0):
    """Return the `SampleSet` with weights, of at most `count` points, by `rom.cubature` of
    `PodFields`; candidates: as for `drawn_samples`, a random part of them. Raises ValueError
    for too few.
    """
    offered = drawn_samples(candidates, min(CANDIDATES, len(numbers_of(candidates))), seed).points
    fit = cubature(fields.U, fields.r, offered, count)
    return SampleSet(since, fit.points, fit.w, fit.misfit)


def cell_samples(fields, problem, candidates, count, seed, since=0.0):
    """Return the `SampleSet` with weights as `weighted_samples` does, in at most `count` cells of
    random candidates: points that have the same nodes at rest. Raises ValueError for too few.
    """
    numbers = numbers_of(candidates)
    base = bases(fields.X[numbers], problem.dx, problem.scheme.degree)
    _, cell = np.unique(base, axis=0, return_inverse=True)
    middle = drawn_samples(len(numbers), min(MAX_CELLS, len(numbers)), seed).points
    offered = np.flatnonzero(np.isin(cell, cell[middle]))
    _, group = np.unique(cell[offered], return_inverse=True)
    fit = cubature(fields.U, fields.r, numbers[offered], count, group)
    return SampleSet(since, fit.points, fit.w, fit.misfit)


def numbers_of(candidates):
    """Return the numbers of points: of all, if their number is given, or those given."""
    return np.arange(candidates) if np.ndim(candidates) == 0 else candidates


def require_valid_sets(sets, n):
    """Raise ValueError unless samples are there from the start on, each a point of n once and in
    order, with weights of which some are positive and none is negative.
    """
    if not sets or sets[0].since > 0.0:
        raise ValueError("samples from a later time on: expected some from the start on")
    for one in sets:
        points, w = np.asarray(one.points), one.weights
        if not len(points) or points[0] < 0 or points[-1] >= n or (np.diff(points) < 1).any():
            raise ValueError(f"samples {points}: expected some of 0 .. {n - 1}, sorted, each once")
        if w is not None and not (np.isfinite(w).all() and (w >= 0.0).all() and w.any()):
            raise ValueError(f"weights {w} of samples: expected finite numbers, none negative and "
                             "not all 0")
