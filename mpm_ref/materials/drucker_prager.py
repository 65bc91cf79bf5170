"""Drucker-Prager: dry sand on Hencky elasticity (NSF-F3, NCLAW-eq15, NCLAW-eq16).

    tr eps > 0:    s <- 1, the tip of the cone
    dgamma > 0:    eps <- eps - dgamma eps_hat / |eps_hat|
    else           s stays

    dgamma = |eps_hat| + alpha (d lam + 2 mu)/(2 mu) tr eps

Matter in tension carries no stress; this wins over the cone (NCLAW-X7), |dev tau| = -alpha tr
tau. The return keeps the volume, except at the tip: no correction is made for the volume gained
there, as in the papers.
"""

from math import isfinite, radians, sin, sqrt
from typing import NamedTuple

from ..core.jit import kernel
from ..core.tensor import fill, lin, mul, norm, total_of
from .log_strain import deviator, lifted, log_strain, radial_return, stretches
from .log_strain_adjoint import lifted_vjp, log_gap_ratio, log_strain_vjp, radial_vjp
from .moduli import least_stretch
from .no_flow import never_fails


class DruckerPrager(NamedTuple):
    """A cone without cohesion."""

    alpha: float    # slope of the cone, |dev tau| / -tr tau
    s_min: float    # trial singular values are first lifted to it (NCLaw 0.05); 0: they are not


def build(dim, friction_angle, s_min=0.0):
    """Return the cone of a friction angle in degrees.

    Raises ValueError unless 0 <= friction_angle < 90, 0 <= s_min < 1.
    """
    if not (isfinite(friction_angle) and 0.0 <= friction_angle < 90.0):
        raise ValueError(
            f"friction_angle = {friction_angle}: expected degrees, 0 <= friction_angle < 90"
        )
    return DruckerPrager(slope(friction_angle, dim), least_stretch(s_min))


def slope(friction_angle, dim):
    """Return the slope alpha of the cone of a friction angle in degrees.

    In 3D sqrt(2/3) 2 sin/(3 - sin), which equals Mohr-Coulomb in triaxial compression (NSF-F3,
    NCLAW-eq15); in 2D, with the deviator of the plane, sin/sqrt(2), which equals Mohr-Coulomb
    exactly (X-cross-15).
    """
    sine = sin(radians(friction_angle))
    return sine / sqrt(2.0) if dim == 2 else sqrt(2.0 / 3.0) * 2.0 * sine / (3.0 - sine)


@kernel
def project(s, y, dt, law, flow):
    """Return the singular values after the return; y as it is."""
    return radial_return(lifted(s, flow.s_min), y, dt, law, flow)


@kernel
def plastic_strain(d, tr, size, y, law, flow):
    """Return dgamma of tr = tr eps and size = |eps_hat| in d dimensions; y; whether tr > 0, the
    tip.
    """
    return size + steepness(d, law, flow) * tr, y, tr > 0.0


@kernel
def steepness(d, law, flow):
    """Return alpha (d lam + 2 mu)/(2 mu), the cone's slope in strain."""
    return flow.alpha * (d * law.lam + 2.0 * law.mu) / (2.0 * law.mu)


@kernel
def project_vjp(state, bars, dt, law, flow):
    """Return the bars before the return; those of mu, lam, alpha, s_min; the share -k tr
    eps/|eps_hat| of the deviator that is left on the cone |eps_hat| = -k tr eps, k of `steepness`.
    """
    s, (s_bar, y_bar) = state[0], bars
    eps = log_strain(lifted(s, flow.s_min))
    eps_hat = deviator(eps)
    size, tr, k = norm(eps_hat), total_of(eps), steepness(len(s), law, flow)
    dgamma = size + k * tr
    if tr > 0.0:
        return (fill(0.0, s), y_bar), (0.0, 0.0, 0.0, 0.0), 0.0
    elif dgamma > 0.0:
        s_new = stretches(lin(1.0, eps, -dgamma / size, eps_hat))
        eps_bar, radius_bar = radial_vjp(eps, -k * tr, mul(s_new, s_bar), 0.0)
        eps_bar = lin(1.0, eps_bar, -k * radius_bar, fill(1.0, s))
        s_bar, s_min_bar = log_strain_vjp(s, eps_bar, flow.s_min)
        moduli_and_alpha = steepness_vjp(-tr * radius_bar, len(s), law, flow)
        return (s_bar, y_bar), (*moduli_and_alpha, s_min_bar), -k * tr / size
    else:
        s_bar, s_min_bar = lifted_vjp(s, s_bar, flow.s_min)
        return (s_bar, y_bar), (0.0, 0.0, 0.0, s_min_bar), 1.0


@kernel
def steepness_vjp(k_bar, d, law, flow):
    """Return the bars of mu, lam, alpha."""
    of_lam = flow.alpha * d / (2.0 * law.mu)
    of_alpha = (d * law.lam + 2.0 * law.mu) / (2.0 * law.mu)
    return -k_bar * of_lam * law.lam / law.mu, k_bar * of_lam, k_bar * of_alpha


@kernel
def gap_ratio(s, s_new, i, j, share, flow):
    """Return (s'_i - s'_j)/(s_i - s_j)."""
    return log_gap_ratio(s, s_new, i, j, share, flow.s_min)


intact = never_fails
