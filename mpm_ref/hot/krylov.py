"""Preconditioned conjugate gradients on nodal fields (n, d), with the stop tests of HOT.

The product and the preconditioner are functions of a field; the matrix may be semi-definite as
long as b, and what the preconditioner returns, have no part in its null space: there, iterates
stay in its range. Nodes that are held have zero blocks, so preconditioners here are
pseudo-inverses.
"""

from math import inf, isfinite, sqrt
from typing import NamedTuple

import numpy as np

from .multigrid.projectors import inverses, onto_range
from .multigrid.smoothers import times
from .norms import dot


class CGOptions(NamedTuple):
    """CG stops when sqrt(r.P r) <= relative(sqrt(r0.P r0)) sqrt(r0.P r0), r0 = b and P the
    preconditioner: an energy norm (HOT-sec5.3-k), in sqrt(J) for gradients in kg m/s.
    """

    relative: callable      # tolerance, given sqrt(r0.P r0)
    cap: int = 10000        # iterations
    flexible: bool = False  # a preconditioner that varies: one more product of fields
    enough: callable = None     # (x, k, energy) -> whether to end sooner, after k iterations,
                                # which have given x the energy x.A x [J]


class CGResult(NamedTuple):
    """Outcome of a linear solve; `message` is None where the rule was met."""

    x: np.ndarray
    iterations: int
    message: str | None


def one_half(size):
    """Tolerance 1/2: of the coarsest level, and of LBFGS-H (HOT-sec5.3-coarse)."""
    return 0.5


def newton_tolerance(size, tau):
    """k = min(1/2, sqrt(max(size, tau))) of an inexact Newton step (HOT-sec5.3-k).

    `size` is sqrt(g.P g) [sqrt(J)], or ||g||_2 [kg m/s] in Gast2015; tau is a gradient [kg m/s].
    The comparison is of values: as printed.
    """
    return min(0.5, sqrt(max(size, tau)))


def stiffest_tolerance(eps, kappa):
    """tau = eps sqrt(n) max_i kappa_i [kg m/s]: the tolerance of a body that is as stiff as its
    stiffest node throughout (HOT-sec5.3-k).
    """
    return eps * sqrt(len(kappa)) * float(kappa.max(initial=0.0))


def pcg(product, b, inverse, rule):
    """x of product(x) = b, from x = 0; `CGResult`.

    A direction without positive curvature, or a number that is not finite, ends the solve: x is
    then the last sound iterate, or inverse(b) if there is none.
    """
    x, r, z = np.zeros_like(b), b.copy(), inverse(b)
    rz = dot(r, z)
    if not rz > 0.0:
        return CGResult(z, 0, None if rz == 0.0 else f"r.P r = {rz:.3g} in CG: expected > 0")
    goal = (rule.relative(sqrt(rz)) ** 2) * rz
    if rz <= goal:
        return CGResult(x, 0, None)
    p, energy = z.copy(), 0.0
    for k in range(rule.cap):
        Ap = product(p)
        curvature = dot(p, Ap)
        if not 0.0 < curvature < inf:
            return CGResult(x if k else z, k, f"p.A p = {curvature:.3g} in CG: expected > 0")
        alpha = rz / curvature
        x, r_old, r, energy = x + alpha * p, r, r - alpha * Ap, energy + alpha * rz
        z = inverse(r)
        rz_old, rz = rz, dot(r, z)
        if rz <= goal:
            return CGResult(x, k + 1, None)
        if not isfinite(rz):
            return CGResult(x, k + 1, f"r.P r = {rz:.3g} in CG: expected > 0")
        if rule.enough is not None and rule.enough(x, k + 1, energy):
            return CGResult(x, k + 1, None)
        mixed = dot(r_old, z) if rule.flexible else 0.0
        p = z + ((rz - mixed) / rz_old) * p
    return CGResult(x, rule.cap, f"CG reached its cap of {rule.cap} iterations")


def block_jacobi(D):
    """r -> D^+ r for the diagonal blocks D (n, d, d) of a matrix: what the public release takes."""
    inverse = inverses(D, onto_range(D))
    return lambda r: times(inverse, r)


def scalar_jacobi(D):
    """r -> B diag(D)^-1 B r, as the paper prints it; B projects on what the blocks do not hold."""
    B, diagonal = onto_range(D), np.einsum("naa->na", D)
    inverse = np.where(diagonal > 0.0, 1.0 / np.where(diagonal > 0.0, diagonal, 1.0), 0.0)
    return lambda r: times(B, inverse * times(B, r))


def no_preconditioner(D):
    """r -> r."""
    return lambda r: r.copy()


JACOBI = {"block": block_jacobi, "scalar": scalar_jacobi, "none": no_preconditioner}
