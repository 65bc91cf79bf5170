"""The linear system of one implicit step, frozen where the step starts, for linear solvers alone.

Wholly held nodes are taken out: solvers that know nothing of conditions could not bear their rows
of zeros. Nodes held in part, by slip planes, are refused.
"""

from typing import NamedTuple

import numpy as np
import scipy.sparse as sp

from mpm_ref.hot.multigrid.projectors import diagonal_blocks, inverses, onto_range

from .one_step import after
from .stiffness import bar


class Frozen(NamedTuple):
    """H u = b, of n nodes that are free."""

    A: sp.bsr_array         # (n d, n d)  projected Hessian [kg]
    index: np.ndarray       # (n, d)      world indices
    b: np.ndarray           # (n, d)      minus the gradient [kg m/s]
    D: np.ndarray           # (n, d, d)   diagonal blocks of A [kg]
    D_inv: np.ndarray       # (n, d, d)   their inverses [1/kg]
    particles: int


def twisted(dx, E, steps):
    """`Frozen` at the start of a step of the twisted bar, after so many steps by HOT."""
    step = after(bar(dx, E, "hot", steps), steps)
    system = step.stepper.system(step.pose)
    A, (_, g) = system.matrix(system.start), system.evaluate(system.start)
    return frozen(A, system.index, -g, sum(len(body.id) for body in step.bodies))


def frozen(A, index, b, particles):
    """`Frozen` of the free nodes among those with world indices index (n, d).

    Raises ValueError for a node that is free in some directions only.
    """
    d = index.shape[1]
    B = onto_range(diagonal_blocks(A))
    free = B.any(axis=(1, 2))
    if not np.array_equal(B[free], np.tile(np.eye(d), (free.sum(), 1, 1))):
        raise ValueError("a node is free in some directions only: expected nodes held or free")
    rows = np.repeat(free, d)
    A = sp.bsr_array(sp.csr_array(A)[rows][:, rows], blocksize=(d, d))
    A.sort_indices()
    D = diagonal_blocks(A)
    return Frozen(A, index[free], b[free], D, inverses(D, onto_range(D)), particles)


def rigid_modes(index):
    """Translations and rotations (n d, d (d + 1) / 2) of nodes with indices index (n, d)."""
    n, d = index.shape
    x = index - index.mean(axis=0)
    modes = [np.tile(e, (n, 1)) for e in np.eye(d)]
    for a in range(d):
        for b in range(a):
            spin = np.zeros((n, d))
            spin[:, a], spin[:, b] = x[:, b], -x[:, a]
            modes.append(spin)
    return np.stack([mode.reshape(-1) for mode in modes], axis=1)
