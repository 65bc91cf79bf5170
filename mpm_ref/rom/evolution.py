"""Deformation gradients that a reduced run of LDM evolves, in place of those of its map: ours.

LDM takes F from the map in every step (LDM-eq15); the full model evolves it by the grid's velocity
gradient (LDM-alg1). On the grid, the work of the stress then equals the growth of strain energy, to
first order in dt. The map's F is fitted to many states, in which points lay elsewhere in their
cells: its rate is not the grid's gradient, so that a step may add energy of motion. And where the
map lacks a deformation, as that of the dent below a grip, it lacks its stress.

A point keeps F while it is a quadrature point. One that enters takes the F of the map. F follows
the velocities of the grid, before the projection: what the map cannot move still strains the body.
"""

from typing import NamedTuple

import numpy as np

GRADIENTS = MAP, EVOLVED = "map", "evolved"


class EvolvedGradients(NamedTuple):
    """Deformation gradients of the quadrature points of a step, after it."""

    numbers: np.ndarray     # (n,) of the points, sorted
    F: np.ndarray           # (n, d, d)

    def gradients_of(self, numbers, F):
        """Return the deformation gradients (m, d, d) of points of these numbers; of points that
        have none here, those in F (m, d, d).
        """
        if np.array_equal(numbers, self.numbers):
            return self.F
        i = np.minimum(np.searchsorted(self.numbers, numbers), len(self.numbers) - 1)
        known = self.numbers[i] == numbers
        return np.where(known[:, None, None], self.F[i], F)


def evolved(F, L, dt):
    """Return (I + dt L) F (n, d, d), for the velocity gradients L (n, d, d) [1/s] (LDM-alg1)."""
    return F + dt * L @ F
