"""Order of accuracy against the axis-aligned manufactured solution."""

from math import ceil, sqrt
from typing import NamedTuple

import numpy as np

from mpm_ref.explicit import Scheme, Stepper
from mpm_ref.materials import LogNeoHookean, lame

from .axis_aligned import exact, forcing
from .convergence import order, rms
from .lattice import body, lattice
from .periodic import Periodic

E, NU, RHO0, A = 1e7, 0.3, 1000.0, 0.05
C = sqrt(E / RHO0)                      # [m/s], the c of the motion
LAW = LogNeoHookean(*lame(E, NU))
SOUND = sqrt((LAW.lam + 2.0 * LAW.mu) / RHO0)
PERIOD = 2.0 / C
CHECKS = 40


class Case(NamedTuple):
    transfer: str
    degree: int
    per: int
    cells: int
    dim: int = 2
    cfl: float = 0.4

    @property
    def steps(self):
        return CHECKS * ceil(PERIOD * SOUND * self.cells / self.cfl / CHECKS)


def march(case):
    """Max over a period of RMS displacement error / A"""
    d, steps = case.dim, case.steps
    dt = PERIOD / steps
    scheme = Scheme(case.degree, case.transfer)
    spacing = 1.0 / (case.cells * case.per)
    X = lattice([0.0] * d, [1.0] * d, spacing)
    block = body(X, spacing, RHO0, LAW, case.transfer)
    displacement, velocity, strain = exact(d)
    q = block.particles
    q.v[:] = velocity(A, C, -dt/2, *X.T)
    if scheme.affine:
        rate = (strain(A, C, 0.0, *X.T) - strain(A, C, -dt, *X.T)) / dt
        for i in range(d):
            q.C[:, i, i] = rate[:, i]
    x0 = displacement(A, C, 0.0, *X.T)
    q.x[:] = X + x0
    f = strain(A, C, 0.0, *X.T)
    for i in range(d):
        q.F[:, i, i] = 1 + f[:, i]
    stepper = Stepper(scheme, 1.0 / case.cells, d, np.zeros(d), Periodic([case.cells] * d))
    stepper.start([block])
    worst = 0.0
    for k in range(steps):
        q.b[:] = forcing(d)(LAW.mu, LAW.lam, RHO0, A, C, k * dt, *X.T)
        stepper.step([block], k * dt, dt)
        if (k + 1) % (steps // CHECKS) == 0:
            err = rms(q.x - X - displacement(A, C, (k + 1) * dt, *X.T)) / A
            worst = max(worst, err)
            if not worst < 10: return float("inf")
    return worst
