"""Von Mises on Hencky elasticity: |dev tau|_F <= tau_y (NSF-F4, NCLAW-eq18, NCLAW-eq19).

The return (`radial_return`) keeps the volume and goes to the surface as it was before the step.
The yield stress then stays (`VonMises`), grows (`Hardening`: metal) or shrinks until the particle
fails (`Softening`: cake). Where the yield stress of a paper is that of uniaxial tension,
`moduli.yield_radius` converts it.
"""

from typing import NamedTuple

from ..core.jit import kernel
from ..core.tensor import fill, norm
from .log_strain import deviator, lifted, log_strain, radial_return
from .log_strain_adjoint import log_gap_ratio, radial_return_vjp
from .moduli import least_stretch, not_negative, yield_radius
from .no_flow import never_fails


class VonMises(NamedTuple):
    """Von Mises flow without hardening: perfect plasticity."""

    tau_y: float    # radius of the yield surface [Pa]
    s_min: float    # trial singular values that yield are first lifted to it (NCLaw 0.05); 0: no


class Hardening(NamedTuple):
    """The yield stress of a particle grows with its plastic strain."""

    tau_y: float    # radius of the yield surface at the start [Pa]
    xi: float       # hardening coefficient, in units of 2 mu
    s_min: float    # as for VonMises


class Softening(NamedTuple):
    """The yield stress of a particle shrinks with its plastic strain; at 0 it has failed."""

    tau_y: float    # radius of the yield surface at the start [Pa]
    theta: float    # loss of yield stress per plastic strain [Pa]
    s_min: float    # as for VonMises


def build(dim, sigma_y=None, tau_y=None, s_min=0.0):
    """Return perfect plasticity at either yield stress [Pa]; errors as `yield_radius`,
    `least_stretch`.
    """
    return VonMises(yield_radius(dim, sigma_y, tau_y), least_stretch(s_min))


def build_hardening(dim, xi, sigma_y=None, tau_y=None, s_min=0.0):
    """Return hardening with coefficient xi >= 0; other errors as `build`."""
    return Hardening(yield_radius(dim, sigma_y, tau_y), not_negative(xi=xi), least_stretch(s_min))


def build_softening(dim, theta, sigma_y=None, tau_y=None, s_min=0.0):
    """Return softening with theta >= 0 [Pa]; other errors as `build`."""
    radius = yield_radius(dim, sigma_y, tau_y)
    return Softening(radius, not_negative(theta=theta), least_stretch(s_min))


project = radial_return


@kernel
def beyond(size, tau_y, law):
    """Return dgamma = |eps_hat| - tau_y / (2 mu) of size = |eps_hat| (NSF-F4, NCLAW-eq18); 0
    inside.
    """
    dgamma = size - tau_y / (2.0 * law.mu)
    return dgamma if dgamma > 0.0 else 0.0


@kernel
def beyond_of(s, tau_y, law, flow):
    """Return `beyond` of the singular values."""
    return beyond(norm(deviator(log_strain(lifted(s, flow.s_min)))), tau_y, law)


@kernel
def plastic_strain(d, tr, size, y, law, flow):
    """Return dgamma; y as it is; False."""
    return beyond(size, flow.tau_y, law), y, False


@kernel
def project_vjp(state, bars, dt, law, flow):
    """Return the bars before the return; those of mu, lam, tau_y, s_min; the share of the deviator
    left.
    """
    s_bar, r_bar, s_min_bar, share = radial_return_vjp(
        state[0], (bars[0], 0.0), flow.tau_y, law, flow.s_min)
    mu_bar, tau_y_bar = radius_vjp(r_bar, flow.tau_y, law)
    return (s_bar, bars[1]), (mu_bar, 0.0, tau_y_bar, s_min_bar), share


@kernel
def radius_vjp(radius_bar, tau_y, law):
    """Return the bars of mu and tau_y of the radius tau_y/(2 mu) in strain."""
    tau_y_bar = radius_bar / (2.0 * law.mu)
    return -tau_y_bar * tau_y / law.mu, tau_y_bar


@kernel
def harden(d, tr, size, y, law, flow):
    """Return dgamma to the yield stress y; y + 2 mu xi dgamma (NSF-F4); False."""
    dgamma = beyond(size, y, law)
    return dgamma, y + 2.0 * law.mu * flow.xi * dgamma, False


@kernel
def harden_vjp(state, bars, dt, law, flow):
    """Return the bars of mu, lam, tau_y, xi, s_min, as `project_vjp`; tau_y, the first y, is not
    read here.
    """
    s, y = state
    s_bar, y_bar = bars
    dgamma_bar = 2.0 * law.mu * flow.xi * y_bar
    dgamma = beyond_of(s, y, law, flow)
    s_bar, r_bar, s_min_bar, share = radial_return_vjp(s, (s_bar, dgamma_bar), y, law, flow.s_min)
    mu_bar, of_radius = radius_vjp(r_bar, y, law)
    growth = 2.0 * dgamma * y_bar
    of_parameters = mu_bar + flow.xi * growth, 0.0, 0.0, law.mu * growth, s_min_bar
    return (s_bar, y_bar + of_radius), of_parameters, share


@kernel
def soften(d, tr, size, y, law, flow):
    """Return dgamma to the yield stress y; y - theta |eps - proj(eps)|, at least 0 (NSF-F4);
    whether it failed.

    The plastic strain of the step is |eps - proj(eps)| = dgamma. NSF sets mu = lam = 0 in a
    failed particle, whose F is then of no consequence; here its elastic strain is released, s =
    1, so that neither F nor energy grows without meaning.
    """
    dgamma = beyond(size, y, law)
    y = max(y - flow.theta * dgamma, 0.0)
    return dgamma, y, not y > 0.0


@kernel
def carries(y, flow):
    """Return 1, or 0 once the yield stress of a softening particle is 0."""
    return 1.0 if y > 0.0 else 0.0


@kernel
def soften_vjp(state, bars, dt, law, flow):
    """Return the bars as `harden_vjp`, with theta for xi; all are 0 once the particle has
    failed.
    """
    s, y = state
    s_bar, y_bar = bars
    dgamma = beyond_of(s, y, law, flow)
    if not y - flow.theta * dgamma > 0.0:
        return (fill(0.0, s), 0.0), (0.0, 0.0, 0.0, 0.0, 0.0), 0.0
    dgamma_bar = -flow.theta * y_bar
    s_bar, r_bar, s_min_bar, share = radial_return_vjp(s, (s_bar, dgamma_bar), y, law, flow.s_min)
    mu_bar, of_radius = radius_vjp(r_bar, y, law)
    of_parameters = mu_bar, 0.0, 0.0, -dgamma * y_bar, s_min_bar
    return (s_bar, y_bar + of_radius), of_parameters, share


@kernel
def gap_ratio(s, s_new, i, j, share, flow):
    """Return (s'_i - s'_j)/(s_i - s_j); singular values that do not yield are not lifted."""
    return 1.0 if share == 1.0 else log_gap_ratio(s, s_new, i, j, share, flow.s_min)


intact = never_fails
