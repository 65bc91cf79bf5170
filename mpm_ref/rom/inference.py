"""Operator inference: dynamics of latent coordinates, learned from runs [Peherstorfer2016].

    a_{k+1} - 2 a_k + a_{k-1} = K a_k + D (a_k - a_{k-1}) + B u_k + H (a_k x a_k)

a_k are the coordinates of a body on modes (`pod.directions`) after k intervals of equal length, u_k
the load in the interval that begins then, such as gravity, and a x a the products of two
coordinates. The operators K, D, B and H follow from training runs by regularised least squares;
grid, particles and law are not needed, so that a step is a small product of matrices, and nothing
holds a run to what is physical. It is a rival of the papers' methods, and its training loads must
be like those of use.
"""

from typing import NamedTuple

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from ..core.blas import one_thread
from .kinematics import NoBody

SMOOTHING = tuple(10.0**k for k in range(-12, -1))
FOLDS = 4           # of the runs, each left out once


class NotDefinite(ValueError):
    """The matrix of a regression is not positive definite."""


class LatentDynamics(NamedTuple):
    """Learned operators on r latent coordinates and m components of a load."""

    operators: np.ndarray   # (f, r) of the features of `features_of`
    smoothing: float        # of the regression

    @property
    def r(self):
        """Number of latent coordinates."""
        return self.operators.shape[1]

    def states(self, loads):
        """Yield the coordinates a (r,) after each interval, from rest; loads: iterator over the
        load (m,) of each interval. Raises `kinematics.NoBody` where they are not finite.
        """
        a, before, pairs = np.zeros(self.r), np.zeros(self.r), np.triu_indices(self.r)
        for k, u in enumerate(loads):
            with np.errstate(over="ignore", invalid="ignore"):
                change = features_of(a, before, np.asarray(u, dtype=float), pairs) @ self.operators
                a, before = 2.0 * a - before + change, a
            if not np.isfinite(a).all():
                raise NoBody(f"interval {k}: learned coordinates are not finite; is the load "
                             "beyond those of the training runs?")
            yield a


def features_of(a, before, u, pairs):
    """Return the features (.., f) of coordinates a and those an interval before (.., r), and of
    loads u (.., m), on which the operators act. pairs: two arrays of numbers of coordinates, whose
    products are the last features.
    """
    i, j = pairs
    return np.concatenate([a, a - before, u, a[..., i] * a[..., j]], axis=-1)


def fit_dynamics(a, u, smoothing=None):
    """Return the `LatentDynamics` of training runs from rest: coordinates a (runs, K, r) after each
    of K intervals, and the loads u (runs, K, m) in them. smoothing: lam over the mean square of a
    scaled feature; None: by `choose_smoothing`.

    Raises ValueError for arrays whose runs or intervals differ, fewer than two intervals, numbers
    that are not finite, runs without motion, a smoothing that is not positive or too small, and as
    `choose_smoothing` does.
    """
    require_runs(a, u, smoothing)
    if smoothing is None:
        smoothing = choose_smoothing(a, u)
    return LatentDynamics(regression(a, u, smoothing), smoothing)


def regression(a, u, smoothing):
    """Return the operators (f, r) of the least squares with a smoothing; each feature is scaled to
    a root mean square of 1. Raises ValueError for a smoothing that is too small.
    """
    rest = np.zeros_like(a[:, :1])
    before, now = (np.concatenate([rest] * n + [a[:, :-n]], axis=1) for n in (2, 1))
    features = features_of(now, before, u, np.triu_indices(a.shape[2]))
    F = features.reshape(-1, features.shape[-1])
    size = np.sqrt(np.mean(F**2, axis=0))
    size[size == 0.0] = 1.0
    y = (a - 2.0 * now + before).reshape(len(F), -1)
    with one_thread():
        A = F / size
        M = A.T @ A + smoothing * len(F) * np.eye(len(size))
        try:
            return cho_solve(cho_factor(M), A.T @ y) / size[:, None]
        except np.linalg.LinAlgError:
            raise NotDefinite(f"smoothing = {smoothing:g} is too small for features that depend "
                              "on each other, such as loads that keep one direction: expected "
                              "more, such as 1e-6") from None


def choose_smoothing(a, u):
    """Return the one of SMOOTHING whose runs of `LatentDynamics` are nearest to the training runs
    that were left out, a fold of them at a time. Raises ValueError for fewer than two runs, and
    where all break down.
    """
    if len(a) < 2:
        raise ValueError("one training run: expected at least two, of which some are left out")
    folds = np.array_split(np.arange(len(a)), min(FOLDS, len(a)))
    found = {lam: sum(left_out(a, u, fold, lam) for fold in folds) for lam in SMOOTHING}
    best = min(found, key=found.get)
    if not np.isfinite(found[best]):
        raise ValueError("learned dynamics break down on training runs that are left out, with all "
                         "smoothings: expected more runs, or fewer latent coordinates")
    return best


def left_out(a, u, fold, smoothing):
    """Return the sum of squared errors of the runs of a fold by operators of the others; infinite
    where the smoothing is too small, or a run breaks down.
    """
    others = np.setdiff1d(np.arange(len(a)), fold)
    try:
        model = LatentDynamics(regression(a[others], u[others], smoothing), smoothing)
        return sum(np.sum((np.array([*model.states(u[k])]) - a[k]) ** 2) for k in fold)
    except (NotDefinite, NoBody):
        return np.inf


def require_runs(a, u, smoothing):
    """Raise ValueError unless coordinates and loads are those of as many intervals of as many runs,
    finite, with some motion, and a smoothing that is given is positive.
    """
    if a.ndim != 3 or u.ndim != 3 or a.shape[:2] != u.shape[:2]:
        raise ValueError(f"a {a.shape} and u {u.shape}: expected (runs, intervals, r) and (runs, "
                         "intervals, m)")
    if a.shape[1] < 2:
        raise ValueError("runs of one interval: expected at least two, for second differences")
    if not (np.isfinite(a).all() and np.isfinite(u).all()):
        raise ValueError("coordinates or loads that are not finite: leave out runs that broke down")
    if not a.any():
        raise ValueError("no coordinate differs from 0: expected runs that move")
    if smoothing is not None and not 0.0 < smoothing < np.inf:
        raise ValueError(f"smoothing = {smoothing}: expected a positive number, such as 1e-6")
