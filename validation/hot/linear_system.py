"""The linear system of one implicit step, frozen where the step starts, and CG that measures it.

Nodes that are held in all directions are removed: solvers without conditions could not bear their
rows of zeros. Nodes held in some directions, by slip planes, are refused.

The stop of `krylov.pcg` is in the norm of the preconditioner: two preconditioners would stop at
different errors. Here it is sqrt(r.D^-1 r) <= reduction sqrt(b.D^-1 b), D the diagonal blocks.
"""

from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
from scipy.linalg import eigvalsh_tridiagonal

from mpm_ref.hot.multigrid.projectors import diagonal_blocks, inverses, onto_range
from mpm_ref.hot.multigrid.smoothers import times
from mpm_ref.hot.norms import dot

from .one_step import step_after
from .stiffness import bar


class FrozenSystem(NamedTuple):
    """The system H u = b of n nodes that are free."""

    A: sp.bsr_array         # (n d, n d)  projected Hessian [kg]
    index: np.ndarray       # (n, d)      world indices
    b: np.ndarray           # (n, d)      minus the gradient [kg m/s]
    D: np.ndarray           # (n, d, d)   diagonal blocks of A [kg]
    D_inv: np.ndarray       # (n, d, d)   their inverses [1/kg]
    particles: int


def twisted(dx, E, steps):
    """Return the `FrozenSystem` of a step of the twisted bar, after a number of steps by HOT."""
    return frozen(*linearized(step_after(bar(dx, E, "hot", steps), steps)))


def linearized(step):
    """Return the Hessian, the world indices, minus the gradient and the number of particles.

    They are those of an `ImplicitStep` at its start.
    """
    system = step.stepper.system(step.pose)
    A, (_, g) = system.matrix(system.start), system.evaluate(system.start)
    return A, system.index, -g, step.particles


def frozen(A, index, b, particles):
    """Return the `FrozenSystem` of the free nodes of a matrix A, a right-hand side b (n, d).

    index (n, d): world indices of all nodes; particles: number of particles.

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
    return FrozenSystem(A, index[free], b[free], D, inverses(D, onto_range(D)), particles)


def rigid_modes(index):
    """Return translations and rotations (n d, d (d + 1) / 2) of nodes of indices (n, d)."""
    n, d = index.shape
    x = index - index.mean(axis=0)
    modes = [np.tile(e, (n, 1)) for e in np.eye(d)]
    for a in range(d):
        for b in range(a):
            spin = np.zeros((n, d))
            spin[:, a], spin[:, b] = x[:, b], -x[:, a]
            modes.append(spin)
    return np.stack([mode.reshape(-1) for mode in modes], axis=1)


class CGLimits(NamedTuple):
    """The limits at which CG stops."""

    reduction: float = 1e-6
    cap: int = 1000             # iterations


class CGHistory(NamedTuple):
    """A solve; steps and ratios are the coefficients alpha and beta of its iterations."""

    x: np.ndarray
    converged: bool
    steps: list
    ratios: list

    @property
    def iterations(self):
        """Return the number of iterations: products with the matrix."""
        return len(self.steps)


def cg(system, inverse, limits, flexible=False):
    """Return the `CGHistory` of CG on a `FrozenSystem` from zero.

    inverse: the preconditioner, r (n, d) -> (n, d). `flexible` bears one that varies. Lost
    positivity ends the solve unconverged.
    """
    A, b, D_inv = system.A, system.b, system.D_inv
    x, r, z = np.zeros_like(b), b.copy(), inverse(b)
    p, rz, steps, ratios = z.copy(), dot(r, z), [], []
    goal = limits.reduction**2 * dot(r, times(D_inv, r))
    while (left := dot(r, times(D_inv, r))) > goal and len(steps) < limits.cap:
        Ap = (A @ p.reshape(-1)).reshape(p.shape)
        curvature = dot(p, Ap)
        if not (rz > 0.0 and curvature > 0.0):
            break
        steps.append(rz / curvature)
        x += steps[-1] * p
        old, r = r, r - steps[-1] * Ap
        z = inverse(r)
        mixed = dot(old, z) if flexible else 0.0
        ratios.append((dot(r, z) - mixed) / rz)
        rz, p = dot(r, z), z + ratios[-1] * p
    return CGHistory(x, left <= goal, steps, ratios)


def spectrum(history):
    """Return the smallest and the largest Ritz value of M A, from CG with M.

    They lie between the extreme eigenvalues, and come near them before CG converges.
    """
    alpha, beta = np.array(history.steps), np.array(history.ratios[:-1])
    diagonal = 1.0 / alpha
    diagonal[1:] += beta / alpha[:-1]
    values = eigvalsh_tridiagonal(diagonal, np.sqrt(beta) / alpha[:-1])
    return float(values[0]), float(values[-1])


def convergence_factor(history):
    """Return the spectral radius of I - M A, the factor per cycle of M alone, by `spectrum`."""
    low, high = spectrum(history)
    return max(1.0 - low, high - 1.0)
