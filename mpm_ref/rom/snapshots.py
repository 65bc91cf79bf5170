"""Training data of reduced models: full-order runs, all points at all stored time levels.

`Snapshots`, with deformation gradient and velocity, are what a deformation map is made from (LDM).
`Histories`, with stress and affine field, are what the three fields of NSF are made from. Both are
of all points of a scene. `units` and `field_units` are the scales that networks standardise them
by.
"""

from typing import NamedTuple

import numpy as np

from ..store.memmap import empty
from .fields.network import DecoderUnits, FieldUnits

STILL = 1e-12       # standard deviation of a component that does not vary, over its size
PLAIN, FIELDS = ("v", "mu"), ("x", "tau", "C")      # what each run has of its own


class Snapshots(NamedTuple):
    """s runs of n points over k steps; time levels 0 .. k, points in the scene's own
    order.
    """

    X: np.ndarray       # (n, d)                at rest [m]
    m: np.ndarray       # (n,)                  mass [kg]
    V0: np.ndarray      # (n,)                  volume at rest [m^d]
    mu: np.ndarray      # (s, parameters)       what differs between runs
    x: np.ndarray       # (s, k + 1, n, d)      position [m]
    F: np.ndarray       # (s, k + 1, n, d, d)   deformation gradient; None: unknown
    v: np.ndarray       # (s, k + 1, n, d)      velocity [m/s]; None: unknown
    dt: float           #                       length of a step [s]

    def select(self, runs):
        """Return the snapshots of the runs of these numbers."""
        return self._replace(mu=self.mu[runs], x=self.x[runs], F=self.F[runs], v=self.v[runs])

    def flat(self):
        """Return x (s (k + 1), n, d) and F (s (k + 1), n, d, d) of all runs and time levels."""
        return self.x.reshape(-1, *self.X.shape), self.F.reshape(-1, *self.F.shape[2:])


class Histories(NamedTuple):
    """s runs of n points at time levels 0 .. k, a step or several apart; points in the scene's own
    order.
    """

    X: np.ndarray       # (n, d)                    at the start [m]
    m: np.ndarray       # (n,)                      mass [kg]
    V0: np.ndarray      # (n,)                      volume at rest [m^d]
    v: np.ndarray       # (s, n, d)                 velocity at the start [m/s]
    mu: np.ndarray      # (s, parameters)           what differs between runs
    x: np.ndarray       # (s, k + 1, n, d)          position [m]
    tau: np.ndarray     # (s, k + 1, n, d(d+1)/2)   Kirchhoff stress [Pa], values of `symmetric`
    C: np.ndarray       # (s, k + 1, n, d d)        affine velocity field [1/s]
    dt: float           #                           time between levels [s]

    def select(self, runs):
        """Return the histories of the runs of these numbers."""
        return self._replace(v=self.v[runs], mu=self.mu[runs], x=self.x[runs], tau=self.tau[runs],
                             C=self.C[runs])


def allocate(one, runs):
    """Allocate `Histories` of a number of runs like `one`, of a single run; without values yet."""
    fields = {name: getattr(one, name) for name in FIELDS}
    return one._replace(
        **{name: np.empty_like(getattr(one, name), shape=(runs, *getattr(one, name).shape[1:]))
           for name in PLAIN},
        **{name: empty((runs, *rows.shape[1:]), rows.dtype) for name, rows in fields.items()})


def join_histories(runs, count=None):
    """Return `Histories` of several runs from those of single runs of the same points.

    runs: a sequence, or an iterator of `count` runs, none of which stays in memory. Raises
    ValueError for another number of runs, or points or types other than the first run's, and
    OSError as `memmap.empty` does.
    """
    count, total, k = len(runs) if count is None else count, None, -1
    for k, run in enumerate(runs):
        total = total or allocate(run, count)
        require_like(run, total, k)
        for name in (*PLAIN, *FIELDS):
            getattr(total, name)[k] = getattr(run, name)[0]
    if not 0 < k + 1 == count:
        raise ValueError(f"{k + 1} runs: expected {count or 'some'}")
    return total


def require_like(run, total, k):
    """Raise ValueError unless the `Histories` of run k are of one run and fit those of all."""
    if k >= len(total.mu):
        raise ValueError(f"more than {len(total.mu)} runs: expected so many")
    for name in (*PLAIN, *FIELDS):
        one, rows = getattr(run, name), getattr(total, name)
        if (one.shape, one.dtype) != ((1, *rows.shape[1:]), rows.dtype):
            raise ValueError(f"{name} of run {k}: {one.dtype} of shape {one.shape}; expected "
                             f"{rows.dtype} of shape {(1, *rows.shape[1:])}, as in the first")


def decoder_units(snapshots):
    """Return the `DecoderUnits` of training snapshots (LDM-appB). A component that hardly varies
    gets the unit of the one that varies most, and metres where none does.
    """
    X, u = snapshots.X, snapshots.x - snapshots.X
    axes = tuple(range(u.ndim - 1))
    span = np.ptp(X, axis=0)
    return DecoderUnits(X.min(axis=0), span, u.mean(axis=axes), scales(u.std(axis=axes), span))


def field_units(X, values, mu):
    """Return the `FieldUnits` of points X (n, d) with training values (s, levels, n, k), of s runs
    with parameters mu (s, q) that the field depends on. They are computed run by run, so that the
    values need not be in memory. A value that hardly varies gets the unit of the one that varies
    most, a parameter that does not vary the unit 1. Raises ValueError where a run is not finite.
    """
    for k, run in enumerate(values):
        if not np.isfinite(run).all():
            raise ValueError(f"run {k}: the training values are not all finite; generate it again")
    mean = np.mean([run.mean(axis=(0, 1), dtype=float) for run in values], axis=0)
    square = np.mean([np.mean((run - mean) ** 2, axis=(0, 1)) for run in values], axis=0)
    largest = max(np.abs(run).max() for run in values)
    mu_std = [scales(a.std(keepdims=True), np.abs(a).max())[0] for a in mu.T]
    return FieldUnits(X.min(axis=0), np.ptp(X, axis=0), mean, scales(np.sqrt(square), largest),
                      mu.mean(axis=0), np.array(mu_std))


def scales(std, size):
    """Return the units (k,) of components with standard deviations std (k,).

    A component that hardly varies, compared with its size (k,) or one for all, gets the unit of the
    one that varies most, or 1 where none does.
    """
    varies = std > STILL * size
    return np.where(varies, std, std.max() if varies.any() else 1.0)


def position_error(x, reference, origin=0.0):
    """Return the papers' accumulated position error (LDM-err, NSF-eq11): || x - x' || / || x' -
    origin ||.

    It depends on the origin [m]; see `displacement_error` for one that does not.
    """
    return float(np.linalg.norm(x - reference) / np.linalg.norm(reference - origin))


def displacement_error(x, reference, X):
    """Return || x - x' || / || x' - X ||, the error over the distance that points have moved."""
    return position_error(x, reference, X)
