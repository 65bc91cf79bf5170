"""The neo-Hookean law of NSF-F5, without its flow: shear and volume change do not interact.

    psi(F) = mu/2 (J^(-2/d) tr b - d) + kappa/2 ((J^2 - 1)/2 - log J),    b = F F^T
    tau = kappa/2 (J^2 - 1) I + mu dev(J^(-2/d) b)

tau is printed, psi follows by integration.

In 2D the exponent is -2/2 and the deviator that of the plane (X-cross-15): a model of its own, not
this law at a third stretch of 1. At small strains its modulus against change of area is kappa,
where plane strain has lam + mu = kappa + mu/3. Defined for det F > 0: otherwise psi is inf, which
a line search refuses, and stresses are NaN, which no run overlooks.
"""

from math import inf, log
from typing import NamedTuple

from ..core.jit import kernel
from ..core.tensor import (
    cofactor,
    det,
    diag,
    dot,
    fill,
    identity,
    inner,
    lin,
    mlin,
    mm,
    mmt,
    mul,
    number,
    outer,
    transpose,
)
from .moduli import bulk_modulus, lame
from .stretches import expanded, inverse, volume


class NeoHookean(NamedTuple):
    """Elasticity with separate shear and volume terms."""

    mu: float       # shear modulus [Pa]
    kappa: float    # bulk modulus [Pa]


def from_E_nu(E, nu):
    """Return the law with the mu and kappa of E [Pa] and nu (NSF-F0); errors as `lame`."""
    return NeoHookean(lame(E, nu)[0], bulk_modulus(E, nu))


@kernel
def stiffness(law):
    """Return the modulus lam + 2 mu = kappa + 4 mu / 3 [Pa]; in 2D the law has kappa + mu."""
    return law.kappa + 4.0 * law.mu / 3.0


@kernel
def units(law):
    """Return the law of each modulus alone, 1 Pa: stress is linear in the moduli."""
    return NeoHookean(1.0, 0.0), NeoHookean(0.0, 1.0)


@kernel
def psi(F, law):
    """Return the energy per rest volume [J/m^3]; inf unless det F > 0."""
    J = det(F)
    if not J > 0.0:
        return inf
    shear = J ** (-2.0 / len(F)) * inner(F, F) - len(F)
    return 0.5 * (law.mu * shear + law.kappa * (0.5 * (J * J - 1.0) - log(J)))


@kernel
def parts(J, tr_b, law, like):
    """Return m, t, A [Pa] with tau = m b + (A - t) I."""
    d = number(len(like), J)
    m = law.mu * J ** (-2.0 / d)
    return m, m * (tr_b / d), 0.5 * law.kappa * (J * J - 1.0)


@kernel
def kirchhoff(F, law):
    """Return the Kirchhoff stress kappa/2 (J^2 - 1) I + mu dev(J^(-2/d) F F^T) [Pa]; NaN unless det
    F > 0.
    """
    m, t, A = parts(expanded(det(F)), inner(F, F), law, F)
    return mlin(m, mmt(F, F), A - t, identity(F))


@kernel
def pk1(F, law):
    """Return P = m F + (A - t) F^-T [Pa], with m, t, A of `parts`."""
    J = expanded(det(F))
    m, t, A = parts(J, inner(F, F), law, F)
    return mlin(m, F, (A - t) / J, cofactor(F))


@kernel
def dpk1(F, dF, law):
    """Return the differential dP [Pa], from d(F^-T) = -F^-T dF^T F^-T: no decomposition is
    needed.
    """
    J, d = expanded(det(F)), len(F)
    m, t, A = parts(J, inner(F, F), law, F)
    G = mlin(1.0 / J, cofactor(F), 0.0, F)
    growth = inner(G, dF)                               # dJ / J
    dm = -2.0 / d * m * growth
    dt = (dm * inner(F, F) + 2.0 * m * inner(F, dF)) / d
    dA = law.kappa * J * J * growth
    turned = mm(G, mm(transpose(dF), G))
    return mlin(1.0, mlin(m, dF, dm, F), 1.0, mlin(dA - dt, G, t - A, turned))


@kernel
def kirchhoff_hat(s, law):
    """Return the principal tau_i = m s_i^2 + A - t [Pa]."""
    m, t, A = parts(expanded(volume(s)), dot(s, s), law, s)
    return lin(m, mul(s, s), A - t, fill(1.0, s))


@kernel
def pk1_hat(s, law):
    """Return P_i = m s_i + (A - t)/s_i [Pa]."""
    m, t, A = parts(expanded(volume(s)), dot(s, s), law, s)
    return lin(m, s, A - t, inverse(s))


@kernel
def dpk1_hat(s, law):
    """Return dP_i/ds_j = (kappa J^2 + 2 t/d)/(s_i s_j) - (2 m/d)(s_i/s_j + s_j/s_i) [Pa].

    On the diagonal m + (t - A)/s_i^2 is added.
    """
    J, r, d = expanded(volume(s)), inverse(s), len(s)
    m, t, A = parts(J, dot(s, s), law, s)
    own = diag(lin(m, fill(1.0, s), t - A, mul(r, r)))
    H = mlin(law.kappa * J * J + 2.0 * t / d, outer(r, r), 1.0, own)
    return mlin(1.0, H, -2.0 * m / d, mlin(1.0, outer(s, r), 1.0, outer(r, s)))


@kernel
def pair(s, i, j, law):
    """Return the quotients m + (t - A)/(s_i s_j) and m - (t - A)/(s_i s_j) [Pa]."""
    m, t, A = parts(expanded(volume(s)), dot(s, s), law, s)
    r = inverse(s)
    twist = (t - A) * r[i] * r[j]
    return m + twist, m - twist
