"""Herschel-Bulkley flow with exponent h = 1 (Bingham) on the neo-Hookean law: toothpaste (NSF-F5).

The deviatoric stress of size s = mu |dev b_bar|, b_bar = J^(-2/d) b, above the yield radius tau_y
relaxes towards it,

    s_new = s - (s - tau_y) / (1 + eta / (2 mu dt)) = tau_y + (s - tau_y) eta / (2 mu dt + eta)

by backward Euler of ds/dt = -2 mu (s - tau_y) / eta. J stays. The paper stops here; the strain
with this stress is rebuilt as b_bar_new = D + c I, where D has the direction of dev b_bar and
size s_new / mu, and c makes det b_bar_new = 1. (The common choice c = tr b_bar / d changes J.)
Where det F <= 0, where the law is not defined, nothing is done.
"""

from math import sqrt
from typing import NamedTuple

from ..core.jit import kernel
from ..core.tensor import dot, fill, lin, mul, norm, number, total_of
from .log_strain import deviator
from .moduli import not_negative, yield_radius
from .no_flow import never_fails
from .stretches import inverse, volume


class HerschelBulkley(NamedTuple):
    """Viscoplastic flow at constant volume."""

    tau_y: float    # radius of the yield surface [Pa]
    eta: float      # viscosity [Pa s]; 0: perfect plasticity


def build(dim, eta, sigma_y=None, tau_y=None):
    """Return a flow with viscosity eta >= 0 [Pa s] beyond either yield stress; errors as
    `yield_radius`.
    """
    return HerschelBulkley(yield_radius(dim, sigma_y, tau_y), not_negative(eta=eta))


@kernel
def project(s, y, dt, law, flow):
    """Return the singular values after the relaxation over dt [s]; y as it is."""
    J = volume(s)
    if not J > 0.0:
        return s, y
    d = number(len(s), J)
    scale = J ** (2.0 / d)
    b_bar = lin(1.0 / scale, mul(s, s), 0.0, s)
    D = deviator(b_bar)
    size = law.mu * norm(D)
    if size > flow.tau_y:
        D = lin(relaxed(size, dt, law, flow) / size, D, 0.0, D)
        b_bar = lin(1.0, D, unimodular_shift(D, total_of(b_bar) / d), fill(1.0, s))
        s = roots(lin(scale, b_bar, 0.0, b_bar))
    return s, y


@kernel
def relaxed(size, dt, law, flow):
    """Return s_new [Pa] of a deviatoric stress of size s > tau_y (NSF-F5)."""
    rate = 2.0 * law.mu * dt
    return flow.tau_y + (size - flow.tau_y) * flow.eta / (rate + flow.eta)


@kernel
def unimodular_shift(D, c):
    """Return the c with det(diag(D) + c I) = 1 and all D_i + c > 0; D is traceless, c a bound from
    above.

    In 2D sqrt(1 + |D|^2/2). In 3D the largest root of c^3 - |D|^2/2 c + det D - 1 = 0: Newton's
    method falls onto it from above, where the cubic is convex, until round-off stops it. Relaxed
    from a b_bar with det b_bar = 1, D has c <= tr b_bar / 3: log det(r D + c I) is concave in the
    factor r, and not negative at r = 0 and r = 1 for that c.
    """
    half = 0.5 * dot(D, D)
    if len(D) == 2:
        return sqrt(1.0 + half)
    q = volume(D) - 1.0
    lower = _newton(c, half, q)
    while lower < c:
        c = lower
        lower = _newton(c, half, q)
    return c


@kernel
def _newton(c, half, q):
    return c - ((c * c - half) * c + q) / (3.0 * c * c - half)


@kernel
def roots(x):
    """Return the square roots of the x_i."""
    if len(x) == 2:
        return sqrt(x[0]), sqrt(x[1])
    else:
        return sqrt(x[0]), sqrt(x[1]), sqrt(x[2])


@kernel
def project_vjp(state, bars, dt, law, flow):
    """Return the bars before the relaxation; those of mu, kappa, tau_y, eta; the share of D that is
    left.

    B stands for b_bar here, B_bar for the gradient by it.
    """
    s, (s_bar, y_bar) = state[0], bars
    if not volume(s) > 0.0:
        return bars, (0.0, 0.0, 0.0, 0.0), 1.0
    scale = volume(s) ** (2.0 / len(s))
    B = lin(1.0 / scale, mul(s, s), 0.0, s)
    D = deviator(B)
    size = law.mu * norm(D)
    if not size > flow.tau_y:
        return bars, (0.0, 0.0, 0.0, 0.0), 1.0
    share = relaxed(size, dt, law, flow) / size
    D_new = lin(share, D, 0.0, D)
    B_new = lin(1.0, D_new, unimodular_shift(D_new, total_of(B) / len(s)), fill(1.0, s))
    B_new_bar = lin(0.5 * sqrt(scale), mul(s_bar, inverse(roots(B_new))), 0.0, s)
    D_new_bar = unimodular_vjp(B_new, B_new_bar)
    size_bar, of_parameters = share_vjp(dot(D_new_bar, D), size, dt, law, flow)
    B_bar = deviator(lin(share, D_new_bar, size_bar * law.mu * law.mu / size, D))
    of_log_scale = dot(B_new_bar, B_new) - dot(B_bar, B)
    s_bar = lin(2.0 / scale, mul(B_bar, s), 2.0 / len(s) * of_log_scale, inverse(s))
    return (s_bar, y_bar), of_parameters, share


@kernel
def unimodular_vjp(B, B_bar):
    """Return the bar of the traceless D of B = D + c I, det B = 1: sum_i (dD_i + dc)/B_i = 0 gives
    dc.
    """
    r = inverse(B)
    return lin(1.0, B_bar, -total_of(B_bar) / total_of(r), r)


@kernel
def share_vjp(share_bar, size, dt, law, flow):
    """Return the bar of the size s, and of mu, kappa, tau_y, eta, of the share s_new/s = (tau_y/s)
    (1 - w) + w with w = eta/(2 mu dt + eta) and s = mu |D|.
    """
    rate = 2.0 * law.mu * dt
    flows = rate / (rate + flow.eta)            # 1 - w
    tau_y_bar = share_bar * flows / size
    size_bar = -tau_y_bar * flow.tau_y / size
    w_bar = share_bar * (1.0 - flow.tau_y / size)
    eta_bar = w_bar * flows / (rate + flow.eta)
    mu_bar = (size_bar * size - eta_bar * flow.eta) / law.mu
    return size_bar, (mu_bar, 0.0, tau_y_bar, eta_bar)


@kernel
def gap_ratio(s, s_new, i, j, share, flow):
    """Return (s'_i - s'_j)/(s_i - s_j), as s'_i^2 - s'_j^2 is that share of s_i^2 - s_j^2."""
    return share * (s[i] + s[j]) / (s_new[i] + s_new[j])


intact = never_fails
