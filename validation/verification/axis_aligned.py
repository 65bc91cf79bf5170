"""Axis-aligned displacement [WallstedtGuilkey2008]: each component depends on its own coordinate.

    u_i = A sin(2 pi X_i) sin(c pi t + phi_i),     phi = (0, 2 pi/3, 4 pi/3),     c^2 = E / rho0

on the unit square or cube, which stays itself and repeats periodically.
"""

from functools import cache

import sympy as sp

from .manufactured import T, body_force, function, log_neo_hookean

A, SPEED = sp.symbols("A c", positive=True)
PHASES = (0, 2 * sp.pi / 3, 4 * sp.pi / 3)


def coordinates(d):
    """Symbols of the material coordinates."""
    return sp.symbols(f"X0:{d}", real=True)


def displacement(d):
    """u(X, t), a list of d expressions."""
    return [
        A * sp.sin(2 * sp.pi * X_i) * sp.sin(SPEED * sp.pi * T + phase)
        for X_i, phase in zip(coordinates(d), PHASES, strict=False)
    ]


@cache
def exact(d):
    """NumPy functions of (A, c, t, *X): displacement, velocity (N, d) and F_ii - 1 (N, d)."""
    u, X = displacement(d), coordinates(d)
    arguments = (A, SPEED, T, *X)
    strain = [sp.diff(u_i, X_i) for u_i, X_i in zip(u, X, strict=True)]
    velocity = [sp.diff(u_i, T) for u_i in u]
    return tuple(function(arguments, f) for f in (u, velocity, strain))


@cache
def forcing(d):
    """NumPy function of (mu, lam, rho0, A, c, t, *X): body force (N, d) [m/s^2]."""
    from_rest = [X_i + u_i for X_i, u_i in zip(coordinates(d), displacement(d), strict=True)]
    b = body_force(from_rest, coordinates(d), log_neo_hookean)
    from .manufactured import LAM, MU, RHO0
    return function((MU, LAM, RHO0, A, SPEED, T, *coordinates(d)), b)
