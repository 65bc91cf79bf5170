"""Columns of matter that settle under their weight and cannot widen.

A column stands along x, from a floor at x = 0 to a free surface at x = H. At rest the stress along
it balances the weight above, whatever the law: P_xx(X) = -rho0 g (H - X).

The floor is there in two ways: as a sticky wall, and without a wall by symmetry, as the middle of a
column from -H to H whose weight points to its middle everywhere.
"""

from math import pi, sqrt
from typing import NamedTuple

import numpy as np

from mpm_ref.core.grid import OutOfRange
from mpm_ref.materials import stiffness

from .settle import Pace, settle
from .strip import ON_WALL, stepper, strip

CFL = 0.4


class Column(NamedTuple):
    """A problem."""

    law: tuple
    height: float       # H at rest [m]
    rho0: float         # [kg/m^2]
    g: float = 10.0     # [m/s^2]

    @property
    def pressure(self):
        """At the floor [Pa]."""
        return self.rho0 * self.g * self.height

    @property
    def sound(self):
        """Speed of compression waves [m/s]."""
        return sqrt(stiffness(self.law) / self.rho0)


class Settled(NamedTuple):
    """A column at rest, by particle."""

    X: np.ndarray       # height in the column at rest shape, |X| [m]
    x: np.ndarray       # height, |x| [m]
    stress: np.ndarray  # P_xx [Pa]


def settled(column, scheme, cells, wall):
    """`Settled` column with so many cells over H, or None if the run was lost.

    scheme is (transfer, degree, particles per cell and direction).
    """
    dx = column.height / cells
    matter, X = strip(0.0 if wall else -column.height, column.height, dx, column.rho0, column.law,
                      scheme)
    weight = np.zeros((len(X), 2))
    weight[:, 0] = -column.g * np.sign(X)
    lowest = 0.5 * pi * column.sound / column.height
    try:
        settle(matter, stepper(dx, scheme, ON_WALL if wall else None), weight,
               Pace(lowest, CFL * dx / column.sound))
    except OutOfRange:
        return None
    q = matter.particles
    stretch, tau = (q.F, q.tau) if q.F.ndim == 1 else (q.F[:, 0, 0], q.tau[:, 0, 0])
    return Settled(np.abs(X), np.abs(q.x[:, 0]), tau / stretch)


def stress_errors(column, state):
    """Mean and largest error of P_xx, relative to the pressure at the floor; 1 if lost."""
    if state is None:
        return 1.0, 1.0
    exact = -column.rho0 * column.g * (column.height - state.X)
    error = np.minimum(np.abs(state.stress - exact) / column.pressure, 1.0)
    return float(np.mean(error)), float(np.max(error))
