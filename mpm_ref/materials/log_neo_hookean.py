"""Neo-Hookean elasticity with a logarithmic volume term, as manufactured solutions use it.

    psi(F) = mu/2 (F : F - d) - mu log J + lam/2 log^2 J,    J = det F
    tau = mu (F F^T - I) + lam log(J) I

The law of the verification problems of [WallstedtGuilkey2008] and [deVaucorbeil2020]. Defined for
det F > 0: otherwise psi is inf, which a line search refuses, and stresses are NaN, which no run
overlooks. In 2D this is the law in plane strain, exactly.
"""

from math import inf, log
from typing import NamedTuple

from ..core.jit import kernel
from ..core.tensor import (
    cofactor,
    det,
    diag,
    fill,
    identity,
    inner,
    lin,
    mlin,
    mm,
    mmt,
    mul,
    outer,
    transpose,
)
from .moduli import lame
from .stretches import expanded, inverse, volume


class LogNeoHookean(NamedTuple):
    """Elasticity with an energy quadratic in F and in log J."""

    mu: float       # shear modulus [Pa]
    lam: float      # Lame's first parameter [Pa]


def from_E_nu(E, nu):
    """Return the law with Young's modulus E [Pa] and Poisson's ratio nu at rest; errors as
    `lame`.
    """
    return LogNeoHookean(*lame(E, nu))


@kernel
def stiffness(law):
    """Return the modulus lam + 2 mu [Pa]."""
    return law.lam + 2.0 * law.mu


@kernel
def units(law):
    """Return the law of each modulus alone, 1 Pa: stress is linear in the moduli."""
    return LogNeoHookean(1.0, 0.0), LogNeoHookean(0.0, 1.0)


@kernel
def psi(F, law):
    """Return the energy per rest volume [J/m^3]; inf unless det F > 0."""
    J = det(F)
    if not J > 0.0:
        return inf
    e = log(J)
    return 0.5 * law.mu * (inner(F, F) - len(F)) + e * (0.5 * law.lam * e - law.mu)


@kernel
def isotropic(J, law):
    """Return the c = lam log J - mu [Pa] of tau = mu F F^T + c I; NaN unless J > 0."""
    return law.lam * log(expanded(J)) - law.mu


@kernel
def pk1(F, law):
    """Return P = mu F + c F^-T [Pa]; NaN unless det F > 0."""
    J = expanded(det(F))
    return mlin(law.mu, F, isotropic(J, law) / J, cofactor(F))


@kernel
def kirchhoff(F, law):
    """Return the Kirchhoff stress mu F F^T + c I [Pa]; NaN unless det F > 0."""
    return mlin(law.mu, mmt(F, F), isotropic(det(F), law), identity(F))


@kernel
def dpk1(F, dF, law):
    """Return the differential dP = mu dF + lam (G : dF) G - c G dF^T G [Pa], with G = F^-T."""
    J = expanded(det(F))
    G = mlin(1.0 / J, cofactor(F), 0.0, F)
    turned = mm(G, mm(transpose(dF), G))
    volumetric = mlin(law.lam * inner(G, dF), G, -isotropic(J, law), turned)
    return mlin(law.mu, dF, 1.0, volumetric)


@kernel
def kirchhoff_hat(s, law):
    """Return the principal tau_i = mu s_i^2 + c [Pa]."""
    return lin(law.mu, mul(s, s), isotropic(volume(s), law), fill(1.0, s))


@kernel
def pk1_hat(s, law):
    """Return P_i = mu s_i + c/s_i [Pa]."""
    return lin(law.mu, s, isotropic(volume(s), law), inverse(s))


@kernel
def dpk1_hat(s, law):
    """Return dP_i/ds_j = lam/(s_i s_j), and mu - c/s_i^2 more on the diagonal [Pa]."""
    r = inverse(s)
    own = lin(law.mu, fill(1.0, s), -isotropic(volume(s), law), mul(r, r))
    return mlin(law.lam, outer(r, r), 1.0, diag(own))


@kernel
def pair(s, i, j, law):
    """Return the quotients mu - c/(s_i s_j) and mu + c/(s_i s_j) [Pa]."""
    r = inverse(s)
    twist = isotropic(volume(s), law) * r[i] * r[j]
    return law.mu - twist, law.mu + twist
