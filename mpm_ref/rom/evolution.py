"""Deformation gradients that a reduced run of LDM evolves, in place of those of its map: ours.

LDM takes F from the map in every step (LDM-eq15); the full model evolves it by the grid's velocity
gradient (LDM-alg1). The force of a point on the grid is the adjoint of that gradient, so that a
step which evolves F loses as much energy of motion as the stress gains. F of the map is the mean
of many runs at many places in the cells: beside the same force it may add energy in every step, and
where the deformation is not among the map's, as in the dent below a grip, its stress is another.

A point keeps F while it is a quadrature point. One that enters takes the F of the map.
"""

from typing import NamedTuple

import numpy as np

ORIGINS = ("map", "evolved")


class EvolvedGradients(NamedTuple):
    """Deformation gradients of the quadrature points of a step, after it."""

    numbers: np.ndarray     # (n,) of the points, sorted
    F: np.ndarray           # (n, d, d)

    def of(self, numbers, F):
        """Return the deformation gradients (m, d, d) of points of these numbers; of points that
        have none here, those in F (m, d, d).
        """
        if np.array_equal(numbers, self.numbers):
            return self.F
        at = np.minimum(np.searchsorted(self.numbers, numbers), len(self.numbers) - 1)
        known = self.numbers[at] == numbers
        return np.where(known[:, None, None], self.F[at], F)


def evolved(F, L, dt):
    """Return (I + dt L) F (n, d, d), for the velocity gradients L (n, d, d) [1/s] (LDM-alg1)."""
    return F + dt * L @ F
