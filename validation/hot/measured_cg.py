"""Conjugate gradients that stop alike for every preconditioner, and what they saw of its spectrum.

The stop of `krylov.pcg` is in the norm of the preconditioner: two preconditioners would stop at
different errors. Here it is sqrt(r.D^-1 r) <= reduction sqrt(b.D^-1 b), D the diagonal blocks.
"""

from typing import NamedTuple

import numpy as np
from scipy.linalg import eigvalsh_tridiagonal

from mpm_ref.hot.multigrid.smoothers import times
from mpm_ref.hot.norms import dot


class Until(NamedTuple):
    """When to stop."""

    reduction: float = 1e-6
    cap: int = 1000             # iterations


class Course(NamedTuple):
    """What a solve did; steps and ratios are the coefficients alpha and beta of its iterations."""

    x: np.ndarray
    converged: bool
    steps: list
    ratios: list

    @property
    def iterations(self):
        """Products with the matrix."""
        return len(self.steps)


def cg(system, inverse, until, flexible=False):
    """`Course` of CG on a `Frozen` system from zero, with a preconditioner r (n, d) -> (n, d).

    `flexible` bears a preconditioner that varies. Lost positivity ends the solve unconverged.
    """
    A, b, D_inv = system.A, system.b, system.D_inv
    x, r, z = np.zeros_like(b), b.copy(), inverse(b)
    p, rz, steps, ratios = z.copy(), dot(r, z), [], []
    goal = until.reduction**2 * dot(r, times(D_inv, r))
    while (left := dot(r, times(D_inv, r))) > goal and len(steps) < until.cap:
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
    return Course(x, left <= goal, steps, ratios)


def spectrum(course):
    """Smallest and largest eigenvalue of M A that CG with M has found (Ritz values): they lie
    between the true ones, and come near them before CG converges.
    """
    alpha, beta = np.array(course.steps), np.array(course.ratios[:-1])
    diagonal = 1.0 / alpha
    diagonal[1:] += beta / alpha[:-1]
    values = eigvalsh_tridiagonal(diagonal, np.sqrt(beta) / alpha[:-1])
    return float(values[0]), float(values[-1])


def convergence_factor(course):
    """Spectral radius of I - M A, the factor per cycle of M on its own, from `spectrum`."""
    low, high = spectrum(course)
    return max(1.0 - low, high - 1.0)
