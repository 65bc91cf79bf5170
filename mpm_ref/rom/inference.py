"""Operator inference: dynamics of latent coordinates, learned from runs [Peherstorfer2016].

    a_{k+1} - 2 a + a_{k-1} = K a + D v + B u + H (a x a) + G (a x v) + L (a x u),  v = a - a_{k-1}

a = a_k are the coordinates of a body on modes (`pod.directions`) after k intervals of equal length,
u the load in the interval that begins then, such as gravity, and a x b the products of all
components of both, each pair once in a x a. The operators follow from training runs by regularised
least squares; grid, particles and law are not needed, so that a step is a small product of
matrices, and nothing holds a run to what is physical. It is a rival of the papers' methods, and its
training loads must be like those of use.
"""

from numbers import Integral
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
        """Yield the coordinates a (.., r) after each interval, from rest; loads: iterator over the
        load (.., m) of each interval. Raises `kinematics.NoBody` where they are not finite.
        """
        a = before = np.zeros(self.r)
        pairs = np.triu_indices(self.r)
        for k, u in enumerate(loads):
            u = np.asarray(u, dtype=float)
            a, before = (np.broadcast_to(one, (*u.shape[:-1], self.r)) for one in (a, before))
            with np.errstate(over="ignore", invalid="ignore"):
                change = features_of(a, before, u, pairs) @ self.operators
                a, before = 2.0 * a - before + change, a
            if not np.isfinite(a).all():
                raise NoBody(f"interval {k}: learned coordinates are not finite; is the load "
                             "beyond those of the training runs?")
            yield a


def features_of(a, before, u, pairs):
    """Return the features (.., f) of coordinates a and those an interval before (.., r), and of
    loads u (.., m), on which the operators act. pairs: two arrays of numbers of coordinates, whose
    products are features.
    """
    (i, j), v = pairs, a - before
    return np.concatenate([a, v, u, a[..., i] * a[..., j], products(a, v), products(a, u)],
                          axis=-1)


def products(a, b):
    """Return the products of all components of a (.., r) and b (.., m), (.., r m)."""
    return (a[..., :, None] * b[..., None, :]).reshape(*a.shape[:-1], -1)


def fit_dynamics(a, u, *, r=None, smoothing=None):
    """Return the `LatentDynamics` of training runs from rest: coordinates a (runs, K, R) after each
    of K intervals, and the loads u (runs, K, m) in them. r: how many coordinates, from the first
    on, are learned; smoothing: lam over the mean square of a scaled feature; None: by `choose`.

    Raises ValueError for arrays whose runs or intervals differ, fewer than two intervals, numbers
    that are not finite, runs without motion, an r that is no whole number from 1 to R, a smoothing
    that is not positive or too small, and as `choose` does.
    """
    a, u = (np.asarray(one, dtype=float) for one in (a, u))
    require_runs(a, u, r, smoothing)
    if r is None or smoothing is None:
        r, smoothing = choose(a, u, numbers_to_try(a.shape[2]) if r is None else (r,),
                              SMOOTHING if smoothing is None else (smoothing,))
    return normal_equations(a[..., :r], u).solve(smoothing)


def numbers_to_try(R):
    """Return the numbers of coordinates that `choose` tries, of R: even ones and R."""
    return tuple(sorted({*range(2, R + 1, 2), R}))


class NormalEquations(NamedTuple):
    """The least squares of operators, with features that are scaled to a root mean square of 1."""

    M: np.ndarray           # (f, f)
    b: np.ndarray           # (f, r)
    size: np.ndarray        # (f,) root mean squares of the features
    count: int              # of intervals

    def solve(self, smoothing):
        """Return the `LatentDynamics` with a smoothing. Raises NotDefinite for one that is too
        small.
        """
        try:
            with one_thread():
                factor = cho_factor(self.M + smoothing * self.count * np.eye(len(self.M)))
                scaled = cho_solve(factor, self.b)
        except np.linalg.LinAlgError:
            raise NotDefinite(f"smoothing = {smoothing:g} is too small for features that depend on "
                              "each other, such as loads that keep one direction: expected more, "
                              "such as 1e-6") from None
        return LatentDynamics(scaled / self.size[:, None], smoothing)


def normal_equations(a, u):
    """Return the `NormalEquations` of runs with coordinates a (runs, K, r) and loads u (runs, K,
    m).
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
        return NormalEquations(A.T @ A, A.T @ y, size, len(F))


def choose(a, u, numbers, smoothings):
    """Return the one of these numbers of coordinates, and of smoothings, whose runs of
    `LatentDynamics` are nearest to the training runs that were left out, a fold of them at a time;
    coordinates that are not learned stay 0. Raises ValueError for fewer than two runs, and where
    all break down.
    """
    if len(a) < 2:
        raise ValueError("one training run: expected at least two, of which some are left out")
    folds = np.array_split(np.arange(len(a)), min(FOLDS, len(a)))
    found = np.array([sum(left_out_errors(a, u, fold, r, smoothings) for fold in folds)
                      for r in numbers])
    best = np.unravel_index(np.argmin(found), found.shape)
    if not np.isfinite(found[best]):
        raise ValueError("learned dynamics break down on training runs that are left out, with all "
                         f"smoothings and r in {numbers}: expected more runs, or smaller loads")
    return numbers[best[0]], smoothings[best[1]]


def left_out_errors(a, u, fold, r, smoothings):
    """Return for each smoothing the sum of squared errors of the runs of a fold by operators of the
    others; infinite where the smoothing is too small, or a run breaks down.
    """
    others, found = np.setdiff1d(np.arange(len(a)), fold), np.full(len(smoothings), np.inf)
    equations = normal_equations(a[others, :, :r], u[others])
    for k, smoothing in enumerate(smoothings):
        try:
            states = [*equations.solve(smoothing).states(np.moveaxis(u[fold], 1, 0))]
        except (NotDefinite, NoBody):
            continue
        with np.errstate(over="ignore"):
            found[k] = (np.sum((np.stack(states, axis=1) - a[fold, :, :r]) ** 2)
                        + np.sum(a[fold, :, r:] ** 2))
    return found


def require_runs(a, u, r, smoothing):
    """Raise ValueError unless coordinates and loads are those of as many intervals of as many runs,
    finite, with some motion, an r that is given is a whole number from 1 to R, and a smoothing
    positive.
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
    if r is not None and not (isinstance(r, Integral) and 0 < r <= a.shape[2]):
        raise ValueError(f"r = {r}: expected a whole number from 1 to {a.shape[2]}, the number of "
                         "coordinates")
    if smoothing is not None and not 0.0 < smoothing < np.inf:
        raise ValueError(f"smoothing = {smoothing}: expected a positive number, such as 1e-6")
