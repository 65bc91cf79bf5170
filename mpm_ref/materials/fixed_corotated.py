"""Fixed corotated elasticity (NSF-eq12, NSF-F1, NCLAW-eq12, LDM-sec5-material, HOT-material).

    psi(F) = mu |F - R|^2 + lam/2 (J - 1)^2,    F = R S with det R = 1,    J = det F
    P = 2 mu (F - R) + lam (J - 1) cof(F),      tau = 2 mu (F - R) F^T + lam (J - 1) J I

The second term is that of a fluid. In principal values |F - R|^2 = sum_i (s_i - 1)^2, the last
s_i negative where det F < 0: energy and stress stay finite there and drive an inverted F back. In
2D this is the law in plane strain, exactly. R is not determined where s_i + s_j = 0, on the way
through inversion; there, b_ij would be -inf and is bounded.
"""

from typing import NamedTuple

from ..core.jit import kernel
from ..core.spectral import rotation, stretch
from ..core.tensor import (
    fill,
    identity,
    inner,
    lin,
    mlin,
    mmt,
    mul,
)
from . import fluid, principal
from .moduli import lame

LEAST_SUM = 1e-12       # of s_i + s_j, singular values being of order 1


class FixedCorotated(NamedTuple):
    """Elasticity that is linear in the stretch, apart from the volume term."""

    mu: float       # shear modulus [Pa]
    lam: float      # Lame's first parameter [Pa]


def from_E_nu(E, nu):
    """Return the law with Young's modulus E [Pa] and Poisson's ratio nu at rest; errors as
    `lame`.
    """
    return FixedCorotated(*lame(E, nu))


@kernel
def stiffness(law):
    """Return the modulus lam + 2 mu [Pa]."""
    return law.lam + 2.0 * law.mu


@kernel
def units(law):
    """Return the law of each modulus alone, 1 Pa: stress is linear in the moduli."""
    return FixedCorotated(1.0, 0.0), FixedCorotated(0.0, 1.0)


@kernel
def psi(F, law):
    """Return the energy per rest volume [J/m^3]."""
    D = mlin(1.0, F, -1.0, rotation(F))
    return law.mu * inner(D, D) + fluid.psi(F, law)


@kernel
def pk1(F, law):
    """Return P = 2 mu (F - R) + lam (J - 1) cof(F) [Pa] (NCLAW-eq12)."""
    D = mlin(1.0, F, -1.0, rotation(F))
    return mlin(2.0 * law.mu, D, 1.0, fluid.pk1(F, law))


@kernel
def kirchhoff(F, law):
    """Return the Kirchhoff stress 2 mu (F - R) F^T + lam (J - 1) J I [Pa] (NSF-eq12, whose print
    lacks I).
    """
    return kirchhoff_of_stretch(F, stretch(F), law)


@kernel
def kirchhoff_of_stretch(F, V, law):
    """Return the Kirchhoff stress 2 mu (F F^T - V) + lam (J - 1) J I [Pa] of F = V R."""
    D = mlin(1.0, mmt(F, F), -1.0, V)
    return mlin(2.0 * law.mu, D, 1.0, fluid.kirchhoff(F, law))


@kernel
def kirchhoff_hat(s, law):
    """Return the principal tau_i = 2 mu s_i (s_i - 1) + lam (J - 1) J [Pa]."""
    x = mul(s, lin(1.0, s, -1.0, fill(1.0, s)))
    return lin(2.0 * law.mu, x, 1.0, fluid.kirchhoff_hat(s, law))


@kernel
def corotated(J, law):
    """Return a, p and dp/dJ [Pa] of tau = a (F F^T - V) + p(J) I."""
    return 2.0 * law.mu, fluid.pressure(J, law), fluid.d_pressure(J, law)


@kernel
def pk1_hat(s, law):
    """Return P_i = 2 mu (s_i - 1) + lam (J - 1) dJ/ds_i [Pa]."""
    return lin(2.0 * law.mu, lin(1.0, s, -1.0, fill(1.0, s)), 1.0, fluid.pk1_hat(s, law))


@kernel
def dpk1_hat(s, law):
    """Return dP_i/ds_j [Pa]."""
    return mlin(2.0 * law.mu, identity(s), 1.0, fluid.dpk1_hat(s, law))


@kernel
def pair(s, i, j, law):
    """Return 2 mu and 2 mu (1 - 2/(s_i + s_j)), each with the fluid's part [Pa]."""
    a, b = fluid.pair(s, i, j, law)
    total = max(s[i] + s[j], LEAST_SUM)
    return 2.0 * law.mu + a, 2.0 * law.mu * (1.0 - 2.0 / total) + b


dpk1 = principal.dpk1
