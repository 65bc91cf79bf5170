"""A cantilever under a dead load, as a boundary value problem in the arc length S.

A section turns by phi and carries the moment M. With the load (0, -P) at S = a, its parts N along
and Q across a section, and the stiffnesses EI, EA, GA (shear, with its factor),

    phi' = M/EI,   M' = P x',   x' = (1 + N/EA) cos phi - Q/GA sin phi,   N = -P sin phi
                                y' = (1 + N/EA) sin phi + Q/GA cos phi,   Q = -P cos phi

phi = x = y = 0 at S = 0 and M = 0 at S = a. With EA = GA = inf this is the elastica of
[Bisshopp1945]; for a small P its end sinks by P a^3/(3 EI) + P a/GA [Timoshenko1921].
"""

from math import inf

import numpy as np
from scipy.integrate import solve_bvp


def deflected(load, length, EI, EA=inf, GA=inf):
    """Places (K, 2) [m] of sections from the clamped end to the loaded one.

    load [N/m], length a [m], EI [N m], EA and GA [N/m].

    Raises ArithmeticError if the solver does not converge.
    """

    def slopes(S, state):
        phi, M, _, _ = state
        c, s = np.cos(phi), np.sin(phi)
        along, across = 1.0 - load * s / EA, -load * c / GA
        dx, dy = along * c - across * s, along * s + across * c
        return np.stack([M / EI, load * dx, dx, dy])

    def ends(clamped, free):
        return np.array([clamped[0], clamped[2] / length, clamped[3] / length,
                         free[1] * length / EI])

    S = np.linspace(0.0, length, 41)
    straight = np.stack([0.0 * S, load * (S - length), S, 0.0 * S])
    solution = solve_bvp(slopes, ends, S, straight, tol=1e-8, max_nodes=20000)
    if not solution.success:
        raise ArithmeticError(f"the elastica under {load} N/m was not found: {solution.message}")
    return solution.y[2:].T


def timoshenko(load, length, EI, GA):
    """Deflection of the loaded end under a small load [m]."""
    return load * length**3 / (3.0 * EI) + load * length / GA
