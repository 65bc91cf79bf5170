"""Deflection of a cantilever, small against Timoshenko's beam and large against the elastica.

The beam lies along x, gripped by sticky walls: its matter goes on for GRIP cells behind x = 0, and all
nodes at x <= 0 rest. It is loaded by the force P, down, spread over the last half of its height at the
free end; the deflection is that of the middle of this part, at a = L - h/4. Loads do not turn.

small: L = 8 h, nu = 0.3, plane strain: EI = E h^3 / (12 (1 - nu^2)), shear factor 5/6. P would bend
an ideal beam by L/500.
large: L = 10 h, nu = 0, P a^2/EI = 2: the end sinks by half the length. The fixed corotated law
is linear in Biot's strain, hence bends linearly, M = EI phi', up to any curvature.
"""

from math import sqrt
from typing import NamedTuple

import numpy as np

from mpm_ref.core.boundary import BoxWalls, Conditions
from mpm_ref.explicit import Scheme, Stepper
from mpm_ref.materials import FixedCorotated, lame, stiffness

from .lattice import body, lattice
from .settle import settle

E, RHO0 = 1e6, 1000.0
GRIP = 2            # cells of the beam behind the wall
CFL = 0.5
SHEAR = 5.0 / 6.0   # factor of a rectangle
FIRST = 1.8751      # first root of cos b cosh b = -1: omega = b^2 sqrt(EI/(rho h))/L^2
ON_WALL = Conditions(walls=BoxWalls((1, None), (None, None), "sticky"))


class Beam(NamedTuple):
    """A problem; the height h is 1 m."""

    length: float       # L [m]
    nu: float
    bend: float         # P a^2 / EI

    @property
    def law(self):
        """Fixed corotated elasticity."""
        return FixedCorotated(*lame(E, self.nu))

    @property
    def EI(self):
        """Bending stiffness in plane strain [N m]."""
        return E / (1.0 - self.nu**2) / 12.0

    @property
    def arm(self):
        """Where the load acts, a [m]."""
        return self.length - 0.25

    @property
    def load(self):
        """P [N/m]."""
        return self.bend * self.EI / self.arm**2


SMALL = Beam(length=8.0, nu=0.3, bend=3.0 / 500.0)
LARGE = Beam(length=10.0, nu=0.0, bend=2.0)


def deflection(beam, scheme, cells, waits, ramp=0.0):
    """Displacement (u, v) of the loaded end [m], with so many cells over the height.

    scheme is (transfer, degree, particles per cell and direction); waits, ramp: see `settle`.
    """
    transfer, degree, per = scheme
    dx, sound = 1.0 / cells, sqrt(stiffness(beam.law) / RHO0)
    X = lattice([-GRIP * dx, -0.5], [beam.length, 0.5], dx / per)
    matter = body(X, dx / per, RHO0, beam.law, transfer)
    load = np.zeros_like(X)
    load[X[:, 0] > beam.length - 0.5, 1] = -beam.load / (0.5 * RHO0)
    lowest = FIRST**2 * sqrt(beam.EI / RHO0) / beam.length**2
    stepper = Stepper(Scheme(degree, transfer), dx, 2, np.zeros(2), ON_WALL)
    settle(matter, stepper, load, lowest, CFL * dx / sound, waits, ramp)
    at_load = np.abs(X[:, 0] - beam.arm) < 0.5 * dx
    return (matter.particles.x - X)[at_load].mean(axis=0)
