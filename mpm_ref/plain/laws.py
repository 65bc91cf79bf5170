"""Isotropic elastic laws as functions of the principal stretches.

F = U diag(s) V^T has the principal stretches s (N, d) and the volume ratio J = det F = prod_k s_k.
An isotropic law is an energy density psi(s) [J/m^3 of rest volume]. Its Kirchhoff stress is

    tau = U diag(tau_1 .. tau_d) U^T,      tau_k = s_k dpsi/ds_k  [Pa]

so that each law below returns the pair psi (N, 1) and tau_k (N, d). Moduli: mu (shear), lam (first
Lame parameter) and kappa (bulk), in Pa. Classes of `mpm_ref.materials` hold the moduli; a law is
chosen by the name of that class.
"""

import numpy as np

from .tensors import compose, svd


def fixed_corotated(s, mu, lam):
    """psi = mu sum_k (s_k - 1)^2 + lam/2 (J - 1)^2 (NCLAW-eq12, NSF-F1)."""
    J = volume(s)
    psi = mu * ((s - 1) ** 2).sum(axis=1, keepdims=True) + lam * (J - 1) ** 2 / 2
    return psi, 2 * mu * (s - 1) * s + lam * (J - 1) * J


def hencky(s, mu, lam):
    """psi = mu sum_k e_k^2 + lam/2 (sum_k e_k)^2 with e_k = log s_k (NSF-F2, NCLAW-eq14)."""
    e = np.log(s)
    tr = e.sum(axis=1, keepdims=True)
    return mu * (e * e).sum(axis=1, keepdims=True) + lam * tr**2 / 2, 2 * mu * e + lam * tr


def neo_hookean(s, mu, kappa):
    """psi = mu/2 (J^(-2/d) sum_k s_k^2 - d) + kappa/2 ((J^2 - 1)/2 - log J), the law of NSF-F5."""
    d, J = s.shape[1], volume(s)
    b = s * s * J ** (-2 / s.dtype.type(d))
    tr = b.sum(axis=1, keepdims=True)
    psi = mu * (tr - d) / 2 + kappa * ((J * J - 1) / 2 - np.log(J)) / 2
    return psi, kappa * (J * J - 1) / 2 + mu * (b - tr / d)


def log_neo_hookean(s, mu, lam):
    """psi = mu/2 (sum_k s_k^2 - d) - mu log J + lam/2 log^2 J [WallstedtGuilkey2008]."""
    log_J, b = np.log(volume(s)), s * s
    psi = mu * (b - 1).sum(axis=1, keepdims=True) / 2 - mu * log_J + lam * log_J**2 / 2
    return psi, mu * (b - 1) + lam * log_J


def fluid(s, lam):
    """psi = lam/2 (J - 1)^2, hence tau_k = lam J (J - 1) for every k (NCLAW-eq20)."""
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
    """J = prod_k s_k (N, 1), the ratio of the volumes after and before the deformation."""
    return s.prod(axis=1, keepdims=True)


def energy_and_stress(s, law):
    """Return psi (N,) [J/m^3] and the principal Kirchhoff stresses tau_k (N, d) [Pa] of a law."""
    psi, tau = LAWS[type(law).__name__](s, *map(s.dtype.type, law))
    return psi[:, 0], tau


def energy(F, law):
    """Return psi (N,) [J/m^3] of F (N, d, d); of a fluid, which carries J alone, of J (N,)."""
    return energy_and_stress(F[:, None] if F.ndim == 1 else svd(F)[1], law)[0]


def kirchhoff(F, law):
    """tau = U diag(tau_k) U^T (N, d, d) [Pa] of F (N, d, d).

    Of a fluid, which carries J (N,) alone, the isotropic value (N,).
    """
    if F.ndim == 1:
        return energy_and_stress(F[:, None], law)[1][:, 0]
    U, s, _ = svd(F)
    return compose(U, energy_and_stress(s, law)[1], U)
