"""The filter that each exchange with the grid is: the decay of one Fourier mode per step.

Particles of equal mass at the same places in each cell, without stress: a step multiplies the
nodal velocities of a mode exp(i theta j), j the number of the node, by

    share + (1 - share) T,    T = mean over p of |sum_i w_ip e_i|^2 + |sum_i w_ip r_ip e_i|^2/D

with e_i = exp(i theta (j_i - j_p)), the second term for APIC and MLS-MPM alone, and the share that
a step leaves of what particles have beyond the grid: 0 without FLIP and relaxation.
"""

from math import log, pi

import numpy as np

from mpm_ref.explicit import Stepper
from mpm_ref.materials import FixedCorotated
from mpm_ref.plain.spline import pairs
from mpm_ref.plain.transfer import moment

from .lattice import Periodic, body, fitted, lattice

CELLS = 8           # of a period
SOFT = FixedCorotated(1e-10, 0.0)       # waves cross 1e-5 of a cell in a step of 1 s, dx = 1 m
SPEED = 1e-8        # [m/s] particles hardly move


def amplification(degree, affine, per, theta):
    """Return T of a mode theta [rad per cell] for `per` particles per cell and direction."""
    x = (np.arange(per)[:, None] + 0.5) / per
    ip = pairs(x, 1.0, degree)
    e = np.exp(1j * theta * ip.node[..., 0])
    T = np.abs((ip.w * e).sum(axis=1)) ** 2
    if affine:
        T += np.abs((ip.w * ip.r[..., 0] * e).sum(axis=1)) ** 2 / moment(1.0, degree)
    return float(T.mean())


def expected_rate(scheme, per, theta, dt=1.0):
    """Return the decay rate -log of the factor per step of an `explicit.Scheme`."""
    share = scheme.share(dt) if scheme.keeps_old_velocity else 0.0
    T = amplification(scheme.degree, scheme.affine, per, theta)
    return -log(share + (1.0 - share) * T)


def measured_rate(scheme, per, waves, steps):
    """Return the mean decay rate per step of a mode with a number of waves in `CELLS` cells of 1 m,
    in steps of 1 s of a plane strip that repeats.
    """
    X = lattice([0.0, 0.0], [CELLS, 1.0], 1.0 / per)
    k = 2.0 * pi * waves / CELLS
    strip = fitted(body(X, 1.0 / per, 1.0, SOFT, scheme.transfer), scheme)
    strip.particles.v[:, 0] = SPEED * np.cos(k * X[:, 0])
    if scheme.affine:
        strip.particles.C[:, 0, 0] = -SPEED * k * np.sin(k * X[:, 0])
    stepper = Stepper(scheme, 1.0, 2, np.zeros(2), Periodic((CELLS, 1)))
    stepper.start([strip])
    sizes = [mode_size(stepper.step([strip], float(n), 1.0), k) for n in range(steps + 1)]
    return -log(sizes[-1] / sizes[0]) / steps


def mode_size(grid, k):
    """Return |sum_j v_j exp(-i k x_j)| over one period of a grid of spacing 1 m [m/s]."""
    j = grid.origin[0] + np.arange(grid.m.shape[0])
    period = (j >= 0) & (j < CELLS)
    row = -grid.origin[1]
    return abs((grid.v[period, row, 0] * np.exp(-1j * k * j[period])).sum())
