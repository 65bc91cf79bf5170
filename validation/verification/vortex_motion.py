"""Generalized vortex [deVaucorbeil2020]: circles of a ring turn by an angle of their own.

    alpha(R, t) = G sin(pi t / period) h(R),   h = (1 - 4 s^2)^2,   s = (R - R_mean)/(R_i - R_o)

turns the particle at radius R about the origin. h and its slope vanish at R_i and R_o: there the
material is at rest and free of stress. All of it shears without change of volume, at most by
max |R h'| G = 6.2 G for the ring 0.75 < R < 1.25.
"""

from functools import cache

import sympy as sp

from .manufactured import LAM, MU, RHO0, T, body_force, function, log_neo_hookean

R, INNER, OUTER, PERIOD = sp.symbols("R R_i R_o period", positive=True)
G = sp.symbols("G", real=True)
X, Y = sp.symbols("X Y", real=True)


def profile(r):
    """h of the radius r."""
    s = (r - (INNER + OUTER) / 2) / (INNER - OUTER)
    return 1 - 8 * s**2 + 16 * s**4


def angle(r):
    """alpha at the radius r."""
    return G * sp.sin(sp.pi * T / PERIOD) * profile(r)


def motion():
    """x(X, t) of the ring, a list of two expressions in X, Y."""
    alpha = angle(sp.sqrt(X**2 + Y**2))
    c, s = sp.cos(alpha), sp.sin(alpha)
    return [c * X - s * Y, s * X + c * Y]


def on_axis(expression):
    """The expression at the particle (R, 0)."""
    return expression.subs({Y: 0}).subs({X: R})


@cache
def forcing():
    """NumPy function of (mu, lam, rho0, G, period, R_i, R_o, t, R): body force (N, 2) [m/s^2], its
    components along the radius and the tangent of the particle at rest.
    """
    b = [on_axis(b_i) for b_i in body_force(motion(), (X, Y), log_neo_hookean)]
    return function((MU, LAM, RHO0, G, PERIOD, INNER, OUTER, T, R), b)


@cache
def exact():
    """NumPy function of (G, period, R_i, R_o, t, R): alpha, d alpha/dt and d alpha/dR, (N, 3)."""
    alpha = angle(R)
    parts = [alpha, sp.diff(alpha, T), sp.diff(alpha, R)]
    return function((G, PERIOD, INNER, OUTER, T, R), parts)
