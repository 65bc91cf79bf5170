"""Elastic laws in principal stretches: s (N, d) are the singular values of F, J their product.

All are isotropic: psi and the principal Kirchhoff stresses tau_k = s_k dpsi/ds_k say everything. A
law is named by the class of its parameters; stresses are in Pa, psi in J/m^d of rest volume.
"""

import numpy as np

from .tensors import compose, svd


def fixed_corotated(s, mu, lam):
    """psi = mu sum (s - 1)^2 + lam/2 (J - 1)^2 (NCLAW-eq12, NSF-F1)."""
    J = volume(s)
    psi = mu * ((s - 1) ** 2).sum(axis=1, keepdims=True) + lam * (J - 1) ** 2 / 2
    return psi, 2 * mu * (s - 1) * s + lam * (J - 1) * J


def hencky(s, mu, lam):
    """psi = mu sum e^2 + lam/2 (sum e)^2, e = log s (NSF-F2, NCLAW-eq14)."""
    e = np.log(s)
    tr = e.sum(axis=1, keepdims=True)
    return mu * (e * e).sum(axis=1, keepdims=True) + lam * tr**2 / 2, 2 * mu * e + lam * tr


def neo_hookean(s, mu, kappa):
    """psi = mu/2 (J^(-2/d) sum s^2 - d) + kappa/2 ((J^2 - 1)/2 - log J), the law of NSF-F5."""
    d, J = s.shape[1], volume(s)
    b = s * s * J ** (-2 / s.dtype.type(d))
    tr = b.sum(axis=1, keepdims=True)
    psi = mu * (tr - d) / 2 + kappa * ((J * J - 1) / 2 - np.log(J)) / 2
    return psi, kappa * (J * J - 1) / 2 + mu * (b - tr / d)


def log_neo_hookean(s, mu, lam):
    """psi = mu/2 (sum s^2 - d) - mu log J + lam/2 log^2 J [WallstedtGuilkey2008]."""
    log_J, b = np.log(volume(s)), s * s
    psi = mu * (b - 1).sum(axis=1, keepdims=True) / 2 - mu * log_J + lam * log_J**2 / 2
    return psi, mu * (b - 1) + lam * log_J


def fluid(s, lam):
    """psi = lam/2 (J - 1)^2, tau_k = lam J (J - 1) (NCLAW-eq20)."""
    J = volume(s)
    return lam * (J - 1) ** 2 / 2, lam * J * (J - 1) * np.ones_like(s)


LAWS = {
    "FixedCorotated": fixed_corotated,
    "Hencky": hencky,
    "NeoHookean": neo_hookean,
    "LogNeoHookean": log_neo_hookean,
    "Fluid": fluid,
}


def volume(s):
    """J = product of the principal stretches, (N, 1)."""
    return s.prod(axis=1, keepdims=True)


def principal(s, law):
    """psi (N,) and principal Kirchhoff stresses (N, d)."""
    psi, tau = LAWS[type(law).__name__](s, *map(s.dtype.type, law))
    return psi[:, 0], tau


def energy(F, law):
    """psi (N,) of F (N, d, d), or of J (N,) for a law that needs J only."""
    return principal(F[:, None] if F.ndim == 1 else svd(F)[1], law)[0]


def kirchhoff(F, law):
    """tau = U diag(tau_k) U^T (N, d, d) of F; the isotropic value (N,) of J (N,)."""
    if F.ndim == 1:
        return principal(F[:, None], law)[1][:, 0]
    U, s, _ = svd(F)
    return compose(U, principal(s, law)[1], U)
