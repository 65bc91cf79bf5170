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
from ..core.tensor import dot, fill, lin, mul, norm, total_of
from .log_strain import deviator
from .moduli import not_negative, yield_radius
from .no_flow import never_fails
from .stretches import volume


class HerschelBulkley(NamedTuple):
    """Viscoplastic flow at constant volume."""

    tau_y: float    # radius of the yield surface [Pa]
    eta: float      # viscosity [Pa s]; 0: perfect plasticity


def build(dim, eta, sigma_y=None, tau_y=None):
    """Flow with viscosity eta >= 0 [Pa s] beyond either yield stress; errors as `yield_radius`."""
    return HerschelBulkley(yield_radius(dim, sigma_y, tau_y), not_negative(eta=eta))


@kernel
def project(s, y, dt, law, flow):
    """Singular values after the relaxation over dt [s]; y as it is."""
    J = volume(s)
    if not J > 0.0:
        return s, y
    scale = J ** (2.0 / len(s))
    b_bar = lin(1.0 / scale, mul(s, s), 0.0, s)
    D = deviator(b_bar)
    size = law.mu * norm(D)
    if size > flow.tau_y:
        D = lin(relaxed(size, dt, law, flow) / size, D, 0.0, D)
        b_bar = lin(1.0, D, unimodular_shift(D, total_of(b_bar) / len(s)), fill(1.0, s))
        s = roots(lin(scale, b_bar, 0.0, b_bar))
    return s, y


@kernel
def relaxed(size, dt, law, flow):
    """s_new [Pa] of a deviatoric stress of size s > tau_y (NSF-F5)."""
    rate = 2.0 * law.mu * dt
    return flow.tau_y + (size - flow.tau_y) * flow.eta / (rate + flow.eta)


@kernel
def unimodular_shift(D, c):
    """The c with det(diag(D) + c I) = 1 and all D_i + c > 0; D is traceless, c a bound from above.

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
    """Square roots of the x_i."""
    if len(x) == 2:
        return sqrt(x[0]), sqrt(x[1])
    else:
        return sqrt(x[0]), sqrt(x[1]), sqrt(x[2])


intact = never_fails
