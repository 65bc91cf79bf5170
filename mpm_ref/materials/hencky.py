"""Hencky elasticity, "StVK" in log strain (NSF-eq13, NSF-F2, NCLAW-eq14, NCLAW-eq17).

    psi(F) = mu sum_i eps_i^2 + lam/2 (sum_i eps_i)^2,    eps = log s,    F = U diag(s) V^T
    tau = U diag(2 mu eps + lam sum(eps)) U^T,            P = tau F^-T

NSF-eq13 prints V^T for the last U^T (then tau is not symmetric); NCLAW-eq14 calls this tau P
(NCLAW-X1). Defined for det F > 0: otherwise psi is inf, which a line search refuses, and stresses
are NaN, which no run overlooks. In 2D this is the law in plane strain, exactly.
"""

from math import inf, log1p
from typing import NamedTuple

from ..core.jit import kernel
from ..core.logarithm import hencky_strain
from ..core.spectral import svd
from ..core.tensor import (
    cofactor,
    det,
    diag,
    dot,
    fill,
    inner,
    lin,
    mlin,
    mm,
    mmt,
    mul,
    outer,
    plus_diagonal,
    scale,
    scale_columns,
    total_of,
    trace,
)
from . import principal
from .log_strain import log_strain
from .moduli import lame
from .stretches import inverse


class Hencky(NamedTuple):
    """Elasticity that is linear in the logarithmic strain."""

    mu: float       # shear modulus [Pa]
    lam: float      # Lame's first parameter [Pa]


def from_E_nu(E, nu):
    """Return the law with Young's modulus E [Pa] and Poisson's ratio nu at rest; errors as
    `lame`.
    """
    return Hencky(*lame(E, nu))


@kernel
def stiffness(law):
    """Return the modulus lam + 2 mu [Pa]."""
    return law.lam + 2.0 * law.mu


@kernel
def units(law):
    """Return the law of each modulus alone, 1 Pa: stress is linear in the moduli."""
    return Hencky(1.0, 0.0), Hencky(0.0, 1.0)


@kernel
def psi(F, law):
    """Return the energy per rest volume [J/m^3]; inf unless det F > 0."""
    return psi_and_pk1(F, law)[0]


@kernel
def pk1(F, law):
    """Return P = U diag(pk1_hat(s)) V^T [Pa]; NaN unless det F > 0."""
    return psi_and_pk1(F, law)[1]


@kernel
def psi_and_pk1(F, law):
    """Return `psi` and `pk1`; of moderate strains without singular values: P = tau cof(F)/J."""
    eps, moderate = hencky_strain(F)
    if moderate:
        J, tau = det(F), kirchhoff_of_strain(eps, law)
        return psi_of_strain(eps, law), scale(1.0 / J, mm(tau, cofactor(F)))
    U, s, V, _ = svd(F)
    energy = psi_hat(s, law) if s[len(s) - 1] > 0.0 else inf
    return energy, mmt(scale_columns(U, pk1_hat(s, law)), V)


@kernel
def psi_of_strain(eps, law):
    """Return mu |eps|^2 + lam/2 (tr eps)^2 [J/m^3] of eps = log(F F^T)/2."""
    return law.mu * inner(eps, eps) + 0.5 * law.lam * trace(eps) * trace(eps)


@kernel
def psi_hat(s, law):
    """Return the energy per rest volume [J/m^3] of singular values s > 0."""
    eps = log_strain(s)
    return law.mu * dot(eps, eps) + 0.5 * law.lam * total_of(eps) * total_of(eps)


@kernel
def kirchhoff(F, law):
    """Return the Kirchhoff stress U diag(kirchhoff_hat(s)) U^T [Pa] (NSF-eq13); NaN unless det F >
    0.
    """
    eps, moderate = hencky_strain(F)
    if moderate:
        return kirchhoff_of_strain(eps, law)
    U, s, _, _ = svd(F)
    return mmt(scale_columns(U, kirchhoff_hat(s, law)), U)


@kernel
def kirchhoff_of_strain(eps, law):
    """Return the Kirchhoff stress 2 mu eps + lam tr(eps) I [Pa] of eps = log(F F^T)/2."""
    return plus_diagonal(scale(2.0 * law.mu, eps), law.lam * trace(eps))


@kernel
def strain_moduli(law):
    """Return a, b [Pa] of tau = a eps + b tr(eps) I."""
    return 2.0 * law.mu, law.lam


@kernel
def kirchhoff_hat(s, law):
    """Return the principal tau_i = 2 mu eps_i + lam sum(eps) [Pa]."""
    eps = log_strain(s)
    return lin(2.0 * law.mu, eps, law.lam * total_of(eps), fill(1.0, eps))


@kernel
def pk1_hat(s, law):
    """Return P_i = tau_i / s_i [Pa]."""
    return mul(kirchhoff_hat(s, law), inverse(s))


@kernel
def dpk1_hat(s, law):
    """Return dP_i/ds_j = lam / (s_i s_j), and (2 mu - tau_i) / s_i^2 more on the diagonal [Pa]."""
    r = inverse(s)
    own = lin(2.0 * law.mu, fill(1.0, s), -1.0, kirchhoff_hat(s, law))
    return mlin(law.lam, outer(r, r), 1.0, diag(mul(own, mul(r, r))))


@kernel
def pair(s, i, j, law):
    """Return (2 mu s_j (eps_i - eps_j)/(s_i - s_j) - tau_j)/(s_i s_j), (P_i + P_j)/(s_i + s_j)
    [Pa].
    """
    P, tau, r = pk1_hat(s, law), kirchhoff_hat(s, law), inverse(s)
    a = (2.0 * law.mu * log_ratio((s[i] - s[j]) * r[j]) - tau[j]) * r[i] * r[j]
    return a, (P[i] + P[j]) * r[i] * r[j] / (r[i] + r[j])


@kernel
def log_ratio(x):
    """Return log(1 + x)/x, 1 at x = 0."""
    return log1p(x) / x if x != 0.0 else 1.0


dpk1 = principal.dpk1
