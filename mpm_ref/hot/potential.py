"""The incremental potential, whose minimiser is the velocity increment of a backward Euler step.

    E(dv) = sum_i m_i |dv_i|^2 / 2 + sum_p V0_p psi(F_p) - dt sum_i m_i b . (v_i + dv_i)    HOT-eq1
    g_i   = m_i dv_i + dt sum_p V0_p P_p (F_p^n)^T dw_ip - dt m_i b                         HOT-eq2
    F_p   = (I + dt sum_i (v_i + dv_i) dw_ip^T) F_p^n

with the gravity b; heights are counted from the nodes at the start of the step. F_p^n is elastic:
return maps are lagged (HOT-sec3.1-seq). Where g = 0, m_i dv_i / dt is the force after the step.
"""

from functools import cached_property

import numpy as np

from ..core.jit import total
from ..core.state import NONE, Grid
from .pattern import pattern_of
from .quadrature import sites_of
from .reach import reach
from .response import response
from .tangent import Tangent, differentials
from .transfer import add_forces, gradients


class Potential:
    """E of the velocity increments dv (n, d) [m/s] of a step of dt [s], on the nodes `unknowns`.

    Particles may have any law and are not changed; gravity (d,) is an acceleration [m/s^2].
    """

    def __init__(self, bodies, unknowns, stencil, dt, gravity):
        self.bodies, self.unknowns, self.stencil, self.dt = bodies, unknowns, stencil, dt
        self.weight = unknowns.m[:, None] * np.asarray(gravity, dtype=float)
        self.box = box_of(unknowns)
        self.at = np.flatnonzero(unknowns.number.reshape(-1) >= 0)
        self.sites = tuple(sites_of(body, self.box, stencil) for body in bodies)

    def energy(self, dv):
        """E(dv) [J]; inf where a law refuses a deformation gradient."""
        return self._respond(dv)

    def evaluate(self, dv):
        """E(dv) [J], and g = dE/d dv (n, d) [kg m/s], which knows no conditions."""
        E = self._respond(dv)
        g = self.collect()
        g += self.unknowns.m[:, None] * dv
        g -= self.dt * self.weight
        return E, g

    def tangent(self, dv, projected=True):
        """`Tangent` at dv: dP/dF of every particle, without its negative eigenvalues if projected
        (HOT-alg1).
        """
        self.spread(self.unknowns.v + dv)
        modes = tuple(differentials(sites, body.law, self.dt, projected)
                      for body, sites in zip(self.bodies, self.sites))
        return Tangent(self, modes)

    @cached_property
    def pattern(self):
        """`Pattern` of the Hessians."""
        return pattern_of(self.unknowns.number, len(self.stencil) - 1)

    def spread(self, u):
        """Velocity gradient of every particle, into sites.T, of the nodal velocities u (n, d)."""
        self._place(u)
        for sites in self.sites:
            gradients(sites, self.box, self.stencil)

    def reach(self, u):
        """Largest velocity [m/s] that the nodal velocities u (n, d) give to a particle."""
        self._place(u)
        return max((reach(sites, self.box, self.stencil) for sites in self.sites), default=0.0)

    def collect(self):
        """sum_p T_p dw_ip (n, d) of the T that the sites hold."""
        self.box.f[:] = 0.0
        for sites in self.sites:
            add_forces(sites, self.box, self.stencil)
        return self.box.f.reshape(-1, self.weight.shape[1])[self.at]

    def _place(self, u):
        self.box.v.reshape(-1, u.shape[1])[self.at] = u

    def _respond(self, dv):
        m, u = self.unknowns.m, self.unknowns.v + dv
        self.spread(u)
        E = total(np.einsum("n,na,na->n", 0.5 * m, dv, dv))
        E -= self.dt * total(np.einsum("na,na->n", self.weight, u))
        for body, sites in zip(self.bodies, self.sites):
            response(sites, body.law, self.dt)
            E += total(sites.psi)
        return float(E)


def box_of(unknowns):
    """Zeroed grid with u (`v`) and f, over the nodes that `unknowns` numbers."""
    shape = unknowns.number.shape
    u, f = np.zeros((2, *shape, len(shape)))
    return Grid(np.zeros(shape), u, f, NONE, unknowns.origin, unknowns.dx)
