"""One-dimensional problems: a strip one cell wide along x, which repeats periodically along y."""

import numpy as np

from mpm_ref.core.boundary import BoxWalls, Conditions
from mpm_ref.explicit import Scheme, Stepper
from mpm_ref.materials import Fluid

from .lattice import body, lattice
from .periodic import Periodic

ON_WALL = Conditions(walls=BoxWalls((1, None), (None, None), "sticky"))    # nodes at x <= 0 rest


def strip(start, end, dx, rho, law, scheme):
    """Body between x = start and end [m] in cells of size dx, and its particles' places X (N,).

    scheme is (transfer, degree, particles per cell and direction).
    """
    transfer, _, per = scheme
    X = lattice([start, 0.0], [end, dx], dx / per)
    return body(X, dx / per, rho, law, transfer, isinstance(law, Fluid)), X[:, 0].copy()


def stepper(dx, scheme, conditions=None):
    """`Stepper` of a strip without gravity."""
    transfer, degree, _ = scheme
    return Stepper(Scheme(degree, transfer), dx, 2, np.zeros(2), Periodic((0, 1), conditions))
