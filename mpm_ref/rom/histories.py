"""What NSF's fields are made of: full-order runs of all points of a scene, with their stress and
affine field.
"""

from typing import NamedTuple

import numpy as np

from ..mapped import empty

PLAIN, FIELDS = ("v", "mu"), ("x", "tau", "C")      # what each run has of its own


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

    def of(self, runs):
        """The histories of some runs."""
        return self._replace(v=self.v[runs], mu=self.mu[runs], x=self.x[runs], tau=self.tau[runs],
                             C=self.C[runs])


def room(one, runs):
    """`Histories` of so many runs like one of them, without values yet."""
    fields = {name: getattr(one, name) for name in FIELDS}
    return one._replace(
        **{name: np.empty_like(getattr(one, name), shape=(runs, *getattr(one, name).shape[1:]))
           for name in PLAIN},
        **{name: empty((runs, *known.shape[1:]), known.dtype) for name, known in fields.items()})


def joined(runs, count=None):
    """`Histories` of single ones of the same points, one after the other: of an iterator, of which
    no run is kept beside what is made of it, there must be `count`. Raises ValueError for another
    number, or other histories than the first, and OSError as `mapped.empty` does.
    """
    count, found, k = len(runs) if count is None else count, None, -1
    for k, run in enumerate(runs):
        found = found or room(run, count)
        require_like(run, found, k)
        for name in (*PLAIN, *FIELDS):
            getattr(found, name)[k] = getattr(run, name)[0]
    if not 0 < k + 1 == count:
        raise ValueError(f"{k + 1} runs: expected {count or 'some'}")
    return found


def require_like(run, found, k):
    """Raise ValueError unless the history of run k is a single one and fits `Histories`."""
    if k >= len(found.mu):
        raise ValueError(f"more than {len(found.mu)} runs: expected so many")
    for name in (*PLAIN, *FIELDS):
        own, known = getattr(run, name), getattr(found, name)
        if (own.shape, own.dtype) != ((1, *known.shape[1:]), known.dtype):
            raise ValueError(f"{name} of run {k}: {own.dtype} of shape {own.shape}; expected "
                             f"{known.dtype} of shape {(1, *known.shape[1:])}, as in the first")
