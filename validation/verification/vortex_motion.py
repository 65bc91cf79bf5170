"""Generalized vortex [deVaucorbeil2020]: circles of a ring turn by an angle of their own.

    alpha(R, t) = G sin(pi t / period) h(R),   h = 1 - 8 s^2 + 16 s^4,   s = (R - R_m)/(R_i - R_o)

turns the particle at radius R about the origin, R_m being the mean of the inner radius R_i and the
outer one R_o. h and its slope vanish at R_i and R_o: there the matter is at rest and free of
stress. It shears without change of volume, at most by max |R dh/dR| G = 7.1 G for 0.75 < R < 1.25.
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

INNER, OUTER = 0.75, 1.25               # R_i, R_o [m]
G, PERIOD = sp.symbols("G period", positive=True)
R = sp.symbols("R", positive=True)
XY = sp.symbols("X Y", real=True)
QUARTER = np.array([[0.0, -1.0], [1.0, 0.0]])       # turn by a right angle
SQUARES = 16                            # per side, to measure the part of a particle in the ring


def angle(r):
    """Return alpha at the radius r."""
    inner, outer = sp.Rational(INNER), sp.Rational(OUTER)
    s = (r - (inner + outer) / 2) / (inner - outer)
    return G * sp.sin(sp.pi * T / PERIOD) * (1 - 8 * s**2 + 16 * s**4)


def motion():
    """Return x(X, t), a list of two expressions in `XY` and `T`."""
    X, Y = XY
    alpha = angle(sp.sqrt(X**2 + Y**2))
    c, s = sp.cos(alpha), sp.sin(alpha)
    return [c * X - s * Y, s * X + c * Y]


@cache
def kinematics():
    """Return the NumPy function of (G, period, t, R): alpha, d alpha/dt and d alpha/dR, (N, 3)."""
    alpha = angle(R)
    return function((G, PERIOD, T, R), [alpha, sp.diff(alpha, T), sp.diff(alpha, R)])


@cache
def forcing():
    """Return the NumPy function of (mu, lam, rho0, G, period, t, R): body force (N, 2) [m/s^2].

    Its components along the radius and the tangent of the particle at rest: the problem looks the
    same along all radii, so it is evaluated at the particle (R, 0).
    """
    b = body_force(motion(), XY, log_neo_hookean)
    on_axis = [b_i.subs({XY[1]: 0}).subs({XY[0]: R}) for b_i in b]
    return function((MU, LAM, RHO0, G, PERIOD, T, R), on_axis)


def printed_forcing(matter, turn, period, t, r):
    """Return b as two public codes have it, with + R (g' h)^2 in its tangential part.

    matter is (mu, lam, rho0), turn is G; radial and tangential part (N, 2) [m/s^2] at radii r.
    """
    b = forcing()(*matter, turn, period, t, r)
    alpha, rate, _ = kinematics()(turn, period, t, r).T
    b[:, 1] += 2.0 * r * rate**2 * np.sin(alpha)
    return b


@cache
def _precise_motion():
    """Return x of G, the period, t and X as a function of mpmath numbers."""
    return sp.lambdify((G, PERIOD, T, *XY), motion(), modules="mpmath")


def forcing_by_differences(law, rho0, parameters, X, t):
    """Return b [m/s^2] (2,) at X (2,) and t [s]; parameters are G and the period [s]."""
    values, x = [mp.mpf(float(a)) for a in parameters], _precise_motion()
    return by_differences(lambda Y, s: x(*values, s, *Y), energy_density(law), rho0, X, t)


class Vortex:
    """The motion at particles X (N, 2) that are squares of side `spacing` [m].

    Particles outside of the ring rest: `hold` puts them back after each step, so that they are part
    of the exact solution. b jumps at R_i and R_o; a particle cut by one of them carries the force
    on its part in the ring. Otherwise the sum of forces on the ring would depend on how many
    particles happen to lie inside, an error that does not decrease steadily with the spacing.
    """

    def __init__(self, X, spacing, matter, turn, period):
        self.X, self._matter, self._motion = X, matter, (turn, period)
        r = np.hypot(*X.T)
        self.measured = (INNER < r) & (r < OUTER)
        self._radial = X / r[:, None]
        self._frame = np.stack([self._radial, self._radial @ QUARTER.T], axis=1)
        share, center = part_in_ring(X, spacing)
        rounded = np.round(np.clip(r, INNER, OUTER), 12)
        self._r, self._index = np.unique(rounded, return_inverse=True)
        self._r_b, self._index_b = np.unique(np.round(center, 12), return_inverse=True)
        self._share = share[:, None]

    def _turned(self, t):
        """Return alpha and its derivatives (N, 3), and the rotations by alpha (N, 2, 2)."""
        a = kinematics()(*self._motion, t, self._r)[self._index]
        c, s = np.cos(a[:, 0]), np.sin(a[:, 0])
        return a, c[:, None, None] * np.eye(2) + s[:, None, None] * QUARTER

    def position(self, t):
        """Return x (N, 2) [m]."""
        return np.einsum("pij,pj->pi", self._turned(t)[1], self.X)

    def velocity(self, t):
        """Return v (N, 2) [m/s]."""
        return self._turned(t)[0][:, 1:2] * (self.position(t) @ QUARTER.T)

    def gradient(self, t):
        """Return F (N, 2, 2)."""
        a, Q = self._turned(t)
        across = np.einsum("pij,pj->pi", Q, self.X) @ QUARTER.T
        return Q + np.einsum("p,pi,pj->pij", a[:, 2], across, self._radial)

    def body_force(self, t):
        """Return b (N, 2) [m/s^2]."""
        b = forcing()(*self._matter, *self._motion, t, self._r_b)[self._index_b]
        return self._share * np.einsum("pk,pki->pi", b, self._frame)

    def hold(self, particles):
        """Put the particles outside of the ring back to rest."""
        outside = ~self.measured
        particles.x[outside] = self.X[outside]
        particles.F[outside] = np.eye(2)
        for rest in (particles.v, particles.tau, particles.L, particles.C):
            if rest.ndim > 1:
                rest[outside] = 0.0


def part_in_ring(X, spacing):
    """Return the share of each particle's square in the ring, and the mean radius of that part."""
    r = np.hypot(*X.T)
    share, center = ((INNER < r) & (r < OUTER)).astype(float), np.clip(r, INNER, OUTER)
    cut = np.minimum(abs(r - INNER), abs(r - OUTER)) < spacing
    offsets = spacing * ((np.arange(SQUARES) + 0.5) / SQUARES - 0.5)
    x, y = X[cut, 0, None, None] + offsets[:, None], X[cut, 1, None, None] + offsets
    radii = np.hypot(x, y).reshape(-1, SQUARES**2)
    inside = (INNER < radii) & (radii < OUTER)
    count = inside.sum(axis=1)
    share[cut] = count / SQUARES**2
    center[cut] = np.where(count, (radii * inside).sum(axis=1) / np.maximum(count, 1), INNER)
    return share, center
