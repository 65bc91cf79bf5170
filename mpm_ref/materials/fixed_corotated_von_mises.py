"""Von Mises flow on fixed corotated elasticity: HOT's metals and sauce (HOT-vonmises).

HOT prints no return map for this pair; this is the one of its index (X-cross-13). With x_k = s_k
(s_k - 1) the principal stress is tau_k = 2 mu x_k + lam (J - 1) J. Where |dev tau| = 2 mu |dev x|
> tau_y, dev x is scaled to the surface at fixed mean x and at *frozen J*, and s_k = (1 + sqrt(1 +
4 x_k))/2 is the stretch with that x_k.

dev tau, which does not contain J, lands on the surface exactly. The true J of the returned
stretches is not the frozen one: log s is concave in x, so that the volume grows, and with it the
mean stress. Over one return, for s_k > 1/2,

    0 <= log(J_new / J) <= G/2 (|dev tau|^2 - tau_y^2) / (2 mu)^2
    G = (4 z - 1) / (z^2 (2 z - 1)^3) at z = min s_k

(G is the largest -d2 log s / dx2 on the way; 3 at z = 1). HOT's aluminium at twice its yield stress
gains 5e-5 (2D) and 6e-5 (3D) of its volume in a return, measured in the tests; and a material that
yields at strains of tens of percent may gain elastic energy, for which no dissipation is promised.
For s_k < 1/2 the stretch of the same stress that is above 1/2 is taken.
"""

from math import sqrt
from typing import NamedTuple

from ..core.jit import kernel
from ..core.tensor import fill, lin, mul, norm
from .log_strain import deviator
from .log_strain_adjoint import radial_vjp
from .moduli import yield_radius
from .no_flow import never_fails
from .von_mises import radius_vjp


class FixedCorotatedVonMises(NamedTuple):
    """Perfect plasticity; J is frozen in the return."""

    tau_y: float    # radius of the yield surface [Pa]


def build(dim, sigma_y=None, tau_y=None):
    """Return the flow with either yield stress [Pa]; errors as `yield_radius`."""
    return FixedCorotatedVonMises(yield_radius(dim, sigma_y, tau_y))


@kernel
def project(s, y, dt, law, flow):
    """Return the singular values after the return; y as it is."""
    x = lin(1.0, mul(s, s), -1.0, s)
    x_hat = deviator(x)
    size, radius = norm(x_hat), flow.tau_y / (2.0 * law.mu)
    if size > radius:
        s = stretch_of(lin(1.0, x, radius / size - 1.0, x_hat))
    return s, y


@kernel
def stretch_of(x):
    """Return s_k >= 1/2 with s_k (s_k - 1) = x_k."""
    if len(x) == 2:
        return _upper(x[0]), _upper(x[1])
    else:
        return _upper(x[0]), _upper(x[1]), _upper(x[2])


@kernel
def _upper(x):
    return 0.5 + sqrt(max(0.25 + x, 0.0))       # x >= -1/4 but for round-off


@kernel
def project_vjp(state, bars, dt, law, flow):
    """Return the bars before the return; those of mu, lam, tau_y; the share of dev x that is
    left.
    """
    s, (s_bar, y_bar) = state[0], bars
    x = lin(1.0, mul(s, s), -1.0, s)
    x_hat = deviator(x)
    size, radius = norm(x_hat), flow.tau_y / (2.0 * law.mu)
    if not size > radius:
        return bars, (0.0, 0.0, 0.0), 1.0
    s_new = stretch_of(lin(1.0, x, radius / size - 1.0, x_hat))
    x_bar, radius_bar = radial_vjp(x, radius, mul(s_bar, d_stretch_of(s_new)), 0.0)
    mu_bar, tau_y_bar = radius_vjp(radius_bar, flow.tau_y, law)
    s_bar = mul(x_bar, lin(2.0, s, -1.0, fill(1.0, s)))
    return (s_bar, y_bar), (mu_bar, 0.0, tau_y_bar), radius / size


@kernel
def d_stretch_of(s):
    """Return ds_k/dx_k = 1/(2 s_k - 1); 0 at s_k = 1/2, where x_k is held at its least value."""
    if len(s) == 2:
        return _d_upper(s[0]), _d_upper(s[1])
    else:
        return _d_upper(s[0]), _d_upper(s[1]), _d_upper(s[2])


@kernel
def _d_upper(s):
    return 1.0 / (2.0 * s - 1.0) if s > 0.5 else 0.0


@kernel
def gap_ratio(s, s_new, i, j, share, flow):
    """Return (s'_i - s'_j)/(s_i - s_j), from x_i - x_j = (s_i - s_j)(s_i + s_j - 1)."""
    below = s_new[i] + s_new[j] - 1.0
    if share == 1.0:
        return 1.0
    else:
        return share * (s[i] + s[j] - 1.0) / below if below > 0.0 else 0.0


intact = never_fails
