"""The table of flows with parameters, and formulas of principal stretches in NumPy."""

from typing import NamedTuple

import numpy as np
from constitutive import LAW, deviator

from mpm_ref.materials import FixedCorotated, Hencky, NeoHookean, make_flow

TAU_Y = 0.4


class Case(NamedTuple):
    """A flow of the table on the law it is written for."""

    law: str
    parameters: dict


CASES = {
    "none": Case("hencky", {}),
    "drucker_prager": Case("hencky", {"friction_angle": 30.0}),
    "von_mises": Case("hencky", {"tau_y": TAU_Y}),
    "von_mises_hardening": Case("hencky", {"tau_y": TAU_Y, "xi": 0.3}),
    "von_mises_softening": Case("hencky", {"tau_y": TAU_Y, "theta": 0.1}),
    "herschel_bulkley": Case("neo_hookean", {"tau_y": TAU_Y, "eta": 5.0}),
    "fluid_projection": Case("fluid", {}),
    "snow_clamp": Case("fixed_corotated", {"s_min": 0.9, "s_max": 1.05}),
    "fixed_corotated_von_mises": Case("fixed_corotated", {"tau_y": TAU_Y}),
}


def all_but(*names):
    return [name for name in CASES if name not in names]


VON_MISES = ("von_mises", "von_mises_hardening", "von_mises_softening")


def setting(name, d, **changed):
    """Law and flow of a case; parameters may be changed."""
    law, parameters = CASES[name]
    return LAW[law], make_flow(name, LAW[law], d, **{**parameters, **changed})


def stretches(rng, d, spread=0.3, n=200):
    """Singular values in descending order (n, d)."""
    return np.sort(np.exp(spread * rng.standard_normal((n, d))), axis=1)[:, ::-1]


def size(x):
    return np.linalg.norm(x, axis=-1)


def kirchhoff_hat(s, law):
    """Principal Kirchhoff stresses (N, d), from their formulas."""
    J = s.prod(axis=-1, keepdims=True)
    if isinstance(law, Hencky):
        return 2 * law.mu * np.log(s) + law.lam * np.log(J)
    if isinstance(law, NeoHookean):
        return law.kappa / 2 * (J**2 - 1) + law.mu * deviator(s**2 * J ** (-2 / s.shape[-1]))
    if isinstance(law, FixedCorotated):
        return 2 * law.mu * s * (s - 1) + law.lam * J * (J - 1)
    return law.lam * J * (J - 1) * np.ones_like(s)


def psi(s, law):
    """Energy density (N,), from its formula."""
    J, d = volume(s), s.shape[1]
    if isinstance(law, Hencky):
        return law.mu * (np.log(s) ** 2).sum(axis=1) + law.lam / 2 * np.log(J) ** 2
    if isinstance(law, NeoHookean):
        shear = (s**2).sum(axis=1) * J ** (-2 / d) - d
        return law.mu / 2 * shear + law.kappa / 2 * ((J**2 - 1) / 2 - np.log(J))
    shear = law.mu * ((s - 1) ** 2).sum(axis=1) if isinstance(law, FixedCorotated) else 0.0
    return shear + law.lam / 2 * (J - 1) ** 2


def dev_tau(s, law):
    """|dev tau| (N,)."""
    return size(deviator(kirchhoff_hat(s, law)))


def volume(s):
    return s.prod(axis=-1)
