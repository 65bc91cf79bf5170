"""Body forces evaluated without any derivation, by differences of motion and energy.

Only what defines a problem is shared with the symbolic forcing: its motion and its energy density.
"""

from functools import cache

import mpmath as mp
import sympy as sp

from . import axis_aligned, vortex_motion
from .manufactured import T, by_differences


def energy(law):
    """psi(F) of the law for a list of lists of mpmath numbers."""

    def psi(F):
        log_J = mp.log(mp.det(mp.matrix(F)))
        square = sum(f * f for row in F for f in row)
        return law.mu / 2 * (square - len(F)) - law.mu * log_J + law.lam / 2 * log_J**2

    return psi


@cache
def _motion(problem, d):
    """x of the parameters, t and X as a function of mpmath numbers."""
    if problem == "vortex":
        X, x = vortex_motion.XY, vortex_motion.motion()
        return sp.lambdify((vortex_motion.G, vortex_motion.PERIOD, T, *X), x, modules="mpmath")
    X = axis_aligned.coordinates(d)
    x = [a + u for a, u in zip(X, axis_aligned.displacement(d), strict=True)]
    return sp.lambdify((axis_aligned.A, axis_aligned.C, T, *X), x, modules="mpmath")


def axis_aligned_forcing(law, rho0, parameters, X, t):
    """b [m/s^2] (d,) at X (d,) and t [s]; parameters are A [m] and c [m/s]."""
    return _forcing("axis-aligned", law, rho0, parameters, X, t)


def vortex_forcing(law, rho0, parameters, X, t):
    """b [m/s^2] (2,) at X (2,) and t [s]; parameters are G and the period [s]."""
    return _forcing("vortex", law, rho0, parameters, X, t)


def _forcing(problem, law, rho0, parameters, X, t):
    given = [mp.mpf(float(a)) for a in parameters]
    motion = _motion(problem, len(X))
    return by_differences(lambda Y, s: motion(*given, s, *Y), energy(law), rho0, X, t)
