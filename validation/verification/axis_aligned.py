"""Axis-aligned displacement [WallstedtGuilkey2008]: each component depends on its own coordinate.

    u_i = A sin(2 pi X_i) sin(c pi t + phi_i),     phi = (0, 2 pi/3, 4 pi/3),     c^2 = E / rho0

in the unit square or cube, which repeats periodically. It is stretched and compressed, at most by
1 +- 2 pi A per axis, and neither sheared nor turned.
"""

from functools import cache

import mpmath as mp
import numpy as np
import sympy as sp

from .manufactured import (
    LAM,
    MU,
    RHO0,
    T,
    body_force,
    by_differences,
    energy_density,
    function,
    log_neo_hookean,
)

A, C = sp.symbols("A c", positive=True)
PHASES = (0, 2 * sp.pi / 3, 4 * sp.pi / 3)


def coordinates(d):
    """Return the symbols of the material coordinates."""
    return sp.symbols(f"X0:{d}", real=True)


def displacement(d):
    """Return u(X, t), a list of d expressions."""
    return [A * sp.sin(2 * sp.pi * X_i) * sp.sin(C * sp.pi * T + phase)
            for X_i, phase in zip(coordinates(d), PHASES[:d], strict=True)]


@cache
def kinematics(d):
    """Return NumPy functions of (A, c, t, *X): displacement, velocity and F_ii - 1, each (N, d)."""
    u, X = displacement(d), coordinates(d)
    velocity = [sp.diff(u_i, T) for u_i in u]
    strain = [sp.diff(u_i, X_i) for u_i, X_i in zip(u, X, strict=True)]
    return tuple(function((A, C, T, *X), f) for f in (u, velocity, strain))


@cache
def forcing(d):
    """Return the NumPy function of (mu, lam, rho0, A, c, t, *X): body force (N, d) [m/s^2]."""
    X = coordinates(d)
    x = [X_i + u_i for X_i, u_i in zip(X, displacement(d), strict=True)]
    return function((MU, LAM, RHO0, A, C, T, *X), body_force(x, X, log_neo_hookean))


@cache
def _precise_motion(d):
    """Return x of A, c, t and X as a function of mpmath numbers."""
    X = coordinates(d)
    x = [a + u for a, u in zip(X, displacement(d), strict=True)]
    return sp.lambdify((A, C, T, *X), x, modules="mpmath")


def forcing_by_differences(law, rho0, parameters, X, t):
    """Return b [m/s^2] (d,) at X (d,) and t [s]; parameters are A [m] and c [m/s]."""
    values, motion = [mp.mpf(float(a)) for a in parameters], _precise_motion(len(X))
    return by_differences(lambda Y, s: motion(*values, s, *Y), energy_density(law), rho0, X, t)


class AxisAligned:
    """The motion at particles X (N, d) of a law and a density rho0 [kg/m^3].

    amplitude is A [m], c the speed [m/s]; one oscillation takes 2/c seconds.
    """

    def __init__(self, X, law, rho0, amplitude, c):
        self.X, self.measured = X, slice(None)
        self._kinematics, self._forcing = kinematics(X.shape[1]), forcing(X.shape[1])
        self._motion, self._matter = (amplitude, c), (law.mu, law.lam, rho0)

    def position(self, t):
        """Return x (N, d) [m]."""
        return self.X + self._kinematics[0](*self._motion, t, *self.X.T)

    def velocity(self, t):
        """Return v (N, d) [m/s]."""
        return self._kinematics[1](*self._motion, t, *self.X.T)

    def gradient(self, t):
        """Return F (N, d, d)."""
        d = self.X.shape[1]
        return np.eye(d) * (1.0 + self._kinematics[2](*self._motion, t, *self.X.T))[:, :, None]

    def body_force(self, t):
        """Return b (N, d) [m/s^2]."""
        return self._forcing(*self._matter, *self._motion, t, *self.X.T)

    def hold(self, particles):
        """Do nothing: every particle is free."""
