"""The proximal map of an elastic energy, in principal space: the local step of `admm`.

    Z = argmin psi(Z) + k/2 |Z - A|^2,    A = U diag(s) V^T,    Z = U diag(z) V^T

psi is isotropic, so that Z shares the axes of A, and z solves pk1_hat(z) + k (z - s) = 0. Newton's
method from z = s, on the Hessian without its negative eigenvalues: it descends, so that where there
are several minimisers the one nearby is found, and there is one only if k exceeds the law's
concavity. Steps are halved by the slopes at their ends, since energies would need a decomposition
each.
"""

from math import isfinite

from ..core.jit import kernel
from ..core.tensor import cofactor, det, dot, identity, lin, mlin, mv, norm, total_of
from ..materials.principal import dpk1_hat, pk1_hat, semidefinite

CAP = 50            # Newton steps; a few suffice
HALVINGS = 30       # of each
ROUND_OFF = 1e-13   # gradient over stiffness and size, at which z is found
OVERSHOT = 0.9      # share of the first slope that a step may end with, upwards
LEAST = 0.1         # stretch to begin with where the law has no stress at s


@kernel
def prox(s, k, law):
    """z of the stretches s, for a penalty k [Pa], and 1.0 if round-off was reached, else 0.0."""
    z = begun(s, law)
    r = residual(z, s, k, law)
    for _ in range(CAP):
        H = mlin(1.0, semidefinite(dpk1_hat(z, law)), k, identity(s))
        if norm(r) <= ROUND_OFF * norm(mv(H, lin(1.0, s, 1.0, z))):
            return z, 1.0
        p = mv(cofactor(H), lin(-1.0 / det(H), r, 0.0, r))
        z, r, moved = advanced(z, r, p, (s, k), law)
        if not moved:
            return z, 0.0
    return z, 0.0


@kernel
def residual(z, s, k, law):
    """pk1_hat(z) + k (z - s) [Pa]."""
    return lin(1.0, pk1_hat(z, law), k, lin(1.0, z, -1.0, s))


@kernel
def begun(s, law):
    """s, or stretches for which the law has a stress."""
    if isfinite(total_of(pk1_hat(s, law))):
        return s
    elif len(s) == 2:
        return max(abs(s[0]), LEAST), max(abs(s[1]), LEAST)
    else:
        return max(abs(s[0]), LEAST), max(abs(s[1]), LEAST), max(abs(s[2]), LEAST)


@kernel
def advanced(z, r, p, target, law):
    """z and its residual after a step along p that does not climb, and whether there was one."""
    s, k = target
    slope, alpha = dot(r, p), 1.0
    for _ in range(HALVINGS):
        trial = lin(1.0, z, alpha, p)
        r_new = residual(trial, s, k, law)
        if dot(r_new, p) <= -OVERSHOT * slope:      # NaN is refused
            return trial, r_new, True
        alpha *= 0.5
    return z, r, False
