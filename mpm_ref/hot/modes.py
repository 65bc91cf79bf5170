"""The differential of the stress of particles in principal space, as arrays.

With F_p = U diag(s) V^T and W = F_p^n V, a velocity gradient L changes the stress that acts on the
nodes by

    T = U Y W^T,    Y = apply(A, pairs, U^T L W)

of `materials.principal`. A and pairs, here times dt^2 V0_p, may have their negative eigenvalues set
to zero (HOT-alg1), so that the Hessian is positive semi-definite.
"""

from typing import NamedTuple

import numpy as np

from ..core.jit import kernel


class Modes(NamedTuple):
    """N particles, in the order of their `Sites`."""

    U: np.ndarray       # (N, d, d)
    W: np.ndarray       # (N, d, d)
    A: np.ndarray       # (N, d, d)           [kg m^2]
    ab: np.ndarray      # (N, d(d-1)/2, 2)    a and b of the pairs [kg m^2]


@kernel
def pairs_of(ab, p, like):
    """The pairs of particle p: ((a_01, b_01),) in 2D; those of (0, 1), (0, 2), (1, 2) in 3D."""
    if len(like) == 2:
        return ((ab[p, 0, 0], ab[p, 0, 1]),)
    else:
        return (
            (ab[p, 0, 0], ab[p, 0, 1]),
            (ab[p, 1, 0], ab[p, 1, 1]),
            (ab[p, 2, 0], ab[p, 2, 1]),
        )
