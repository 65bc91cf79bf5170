"""Shares of points' velocities that are prescribed, and the weights that follow from them.

A velocity gathered from the grid is sum_i w_ip v_i over the nodes i of a point p. Its share

    phi_p = sum of w_ip over the nodes i whose velocity is prescribed

is exact. The rest follows from the stress of the reduced field, which is not. With a weight

    1 / (1 - (1 - 1/W) phi_p)

a point without prescribed nodes counts 1 in a least squares, and one that has no others W. No place
in a region, nor its depth, enters: the share follows a region that moves, and ends with it.
"""

import numpy as np

from ..body import Body, particles_at
from ..core.contact import PRESCRIBED
from ..core.grid import Storage
from ..explicit import gather
from ..materials import NoFlow


def prescribed_share(problem, x, t):
    """Return the shares phi (m,) of points x (m, d) [m] in the step of a `Problem` from t [s]."""
    scheme, dt, conditions = problem.scheme, problem.clock.dt, problem.conditions
    nothing = np.zeros(len(x))
    if conditions is None:
        return nothing
    grid = Storage(problem.dx, scheme.stencil, x.shape[1]).cover([x])
    grid.m[:] = 1.0         # conditions pass over nodes without mass
    touches, rules, _ = conditions.touched(grid, t + dt, dt)
    for touch, rule in zip(touches, rules, strict=True):
        if rule == PRESCRIBED:
            grid.v.reshape(-1, x.shape[1])[touch.node] = 1.0
    points = particles_at(x, np.zeros_like(x), nothing, nothing, transfer=scheme.transfer)
    gather(Body("points", points, None, NoFlow(), np.arange(len(x))), grid, scheme, dt)
    return points.v[:, 0]


def weights_by_share(phi, most):
    """Return the weights (m,) of points with shares phi (m,): `most` where all is prescribed."""
    return 1.0 / (1.0 - (1.0 - 1.0 / most) * phi)
