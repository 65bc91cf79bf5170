"""Hencky's law with a von Mises return map inside: the energy that an implicit step minimises.

In a step from the elastic F^n the trial strain eps = log s is that of F before the return, and the
return of NSF-F4 to the radius tau_y is the minimum over plastic strains of the stored energy plus
tau_y times the plastic strain [OrtizStainier1999]: with e = dev eps, n = |e|, k = lam + 2 mu/d,

    psi = k/2 (tr eps)^2 + mu n^2                        where 2 mu n <= tau_y
        = k/2 (tr eps)^2 + tau_y n - tau_y^2/(4 mu)      beyond
    tau = k tr eps + c e,        c = 2 mu or tau_y/n

tau is the stress after the return, and d tau/d eps = k 1 1^T + c (I - 1 1^T/d) - c e e^T/n^2, the
last term beyond only. The names are those of a law, see the package.
"""

from math import inf
from typing import NamedTuple

from ..core.jit import kernel
from ..core.logarithm import hencky_strain
from ..core.spectral import svd
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
    norm,
    number,
    outer,
    plus_diagonal,
    scale,
    scale_columns,
    total_of,
    trace,
)
from .hencky import log_ratio
from .log_strain import deviator, log_strain
from .stretches import inverse


class YieldingHencky(NamedTuple):
    """The law of one particle in one step."""

    mu: float       # shear modulus [Pa]
    lam: float      # Lame's first parameter [Pa]
    tau_y: float    # radius of the yield surface [Pa]


@kernel
def bulk(d, law):
    """Return k = lam + 2 mu/d [Pa] of d dimensions, a float."""
    return law.lam + 2.0 * law.mu / d


@kernel
def secant(size, law):
    """Return c [Pa] of n = |dev eps|."""
    return law.tau_y / size if 2.0 * law.mu * size > law.tau_y else 2.0 * law.mu


@kernel
def energy(tr, size, d, law):
    """Return psi [J/m^3] of tr eps and n."""
    if 2.0 * law.mu * size > law.tau_y:
        shear = law.tau_y * size - law.tau_y * law.tau_y / (4.0 * law.mu)
    else:
        shear = law.mu * size * size
    return 0.5 * bulk(d, law) * tr * tr + shear


@kernel
def psi_and_pk1(F, law):
    """Return psi and P = tau F^-T; inf and NaN unless det F > 0."""
    eps, moderate = hencky_strain(F)
    if moderate:
        tr = trace(eps)
        d = number(len(F), tr)
        e = plus_diagonal(eps, -tr / d)
        size = inner(e, e) ** 0.5
        tau = plus_diagonal(scale(secant(size, law), e), bulk(d, law) * tr)
        return energy(tr, size, d, law), scale(1.0 / det(F), mm(tau, cofactor(F)))
    U, s, V, _ = svd(F)
    psi = inf
    if s[len(s) - 1] > 0.0:
        eps_hat = log_strain(s)
        size = norm(deviator(eps_hat))
        psi = energy(total_of(eps_hat), size, number(len(s), size), law)
    return psi, mmt(scale_columns(U, pk1_hat(s, law)), V)


@kernel
def kirchhoff_hat(s, law):
    """Return the principal tau_i [Pa]."""
    eps = log_strain(s)
    e, tr = deviator(eps), total_of(eps)
    pressure = bulk(number(len(s), tr), law) * tr
    return lin(secant(norm(e), law), e, pressure, fill(1.0, s))


@kernel
def pk1_hat(s, law):
    """Return P_i = tau_i / s_i [Pa]."""
    return mul(kirchhoff_hat(s, law), inverse(s))


@kernel
def dpk1_hat(s, law):
    """Return dP_i/ds_j = (d tau_i/d eps_j - delta_ij tau_i)/(s_i s_j) [Pa]."""
    eps, ones = log_strain(s), fill(1.0, s)
    e, r = deviator(eps), inverse(s)
    size = norm(e)
    d, c = number(len(s), size), secant(size, law)
    slope = mlin(c, identity(s), bulk(d, law) - c / d, outer(ones, ones))
    if c < 2.0 * law.mu:
        slope = mlin(1.0, slope, -c / (size * size), outer(e, e))
    own = mlin(1.0, slope, -1.0, diag(kirchhoff_hat(s, law)))
    R = diag(r)
    return mm(R, mm(own, R))


@kernel
def pair(s, i, j, law):
    """Return a_ij and b_ij [Pa], as `hencky.pair` with c for 2 mu."""
    P, tau, r = pk1_hat(s, law), kirchhoff_hat(s, law), inverse(s)
    c = secant(norm(deviator(log_strain(s))), law)
    a = (c * log_ratio((s[i] - s[j]) * r[j]) - tau[j]) * r[i] * r[j]
    return a, (P[i] + P[j]) * r[i] * r[j] / (r[i] + r[j])
