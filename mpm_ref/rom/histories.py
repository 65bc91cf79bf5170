"""What NSF's fields are made of: full-order runs of all points of a scene, with their stress and
affine field.
"""

from typing import NamedTuple

import numpy as np


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


def joined(runs):
    """`Histories` of several of the same points, one after the other. Of an iterator no run is
    kept beside what is made of it.
    """
    first, fields = None, {name: [] for name in ("v", "mu", "x", "tau", "C")}
    for run in runs:
        first = first or run._replace(**dict.fromkeys(fields))
        for name, parts in fields.items():
            parts.append(getattr(run, name))
    return first._replace(**{name: np.concatenate(fields.pop(name)) for name in list(fields)})
