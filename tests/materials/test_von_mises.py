"""Von Mises on Hencky (NSF-F4, NCLAW-eq18, NCLAW-eq19) and on fixed corotated (HOT-vonmises)."""

from math import sqrt

import numpy as np
import pytest
from constitutive import EPS, deviator, returned
from flows import TAU_Y, VON_MISES, dev_tau, psi, setting, size, stretches, volume

from mpm_ref.materials import FixedCorotated, make_flow, yield_radius


@pytest.mark.parametrize("name", VON_MISES)
def test_von_mises_lands_on_the_surface_before_the_update(name, d, rng):
    law, flow = setting(name, d)
    s, y = stretches(rng, d), rng.uniform(0.8, 1.2, 200)
    before = np.full(200, TAU_Y) if name == "von_mises" else y
    out, _, whole = returned(law, flow, s, y)
    yields = dev_tau(s, law) > before
    assert yields.sum() > 50
    assert whole.all()
    assert np.abs(dev_tau(out, law) - before)[yields].max() < 10 * EPS
    assert (out[~yields] == s[~yields]).all()


@pytest.mark.parametrize("factor", [1.001, 1e3])
def test_von_mises_far_outside(factor, d):
    law, flow = setting("von_mises", d)
    eps = np.zeros((1, d))
    eps[0, :2] = factor * TAU_Y / (2 * law.mu * sqrt(2)) * np.array([1, -1])
    out, _, _ = returned(law, flow, np.exp(eps))
    assert np.isfinite(out).all()
    assert abs(dev_tau(out, law) / TAU_Y - 1) < 1e-10


def test_hardening(d, rng):
    law, flow = setting("von_mises_hardening", d)
    s = stretches(rng, d)
    out, y, _ = returned(law, flow, s, TAU_Y)
    dgamma = size(np.log(s) - np.log(out))
    assert np.abs(y - TAU_Y - 2 * law.mu * flow.xi * dgamma).max() < 10 * EPS
    assert (y >= TAU_Y).all()


def test_softening_and_damage(d, rng):
    law, flow = setting("von_mises_softening", d, theta=1.0)
    s = stretches(rng, d)
    out, y, whole = returned(law, flow, s, TAU_Y)
    dgamma = np.maximum(size(deviator(np.log(s))) - TAU_Y / (2 * law.mu), 0)
    expected = np.maximum(TAU_Y - flow.theta * dgamma, 0)
    assert np.abs(y - expected).max() < EPS
    assert (whole == (expected > 0)).all()
    assert min((y == 0).sum(), ((y > 0) & (y < TAU_Y)).sum()) > 5
    assert (out[y == 0] == 1.0).all()       # nothing is stored in a failed particle
    again, y, whole = returned(law, flow, s, 0.0)
    assert not y.any()
    assert not whole.any()
    assert (again == 1.0).all()


def test_von_mises_with_the_printed_denominator_misses_the_surface(d, rng):
    """NSF-F4 prints |eps| where NCLAW-eq19 has |eps_hat|."""
    law, _ = setting("von_mises", d)
    eps = np.log(stretches(rng, d))
    hat = deviator(eps)
    dgamma = size(hat) - TAU_Y / (2 * law.mu)
    hat, eps, dgamma = (a[dgamma > 0] for a in (hat, eps, dgamma))
    printed = eps - (dgamma / size(eps))[:, None] * hat
    right = eps - (dgamma / size(hat))[:, None] * hat
    assert np.abs(dev_tau(np.exp(right), law) / TAU_Y - 1).max() < 1e-12
    assert np.abs(dev_tau(np.exp(printed), law) / TAU_Y - 1).max() > 0.2


def test_least_stretch_is_for_yielding_particles_only(d):
    """As in NCLaw: von Mises leaves an elastic F alone, however small."""
    law, flow = setting("von_mises", d, s_min=0.05)
    s = np.full((3, d), 0.01)
    s[1, 0] = 1.0
    s[2, 0], s[2, -1] = 1.0, -1.0
    out, _, _ = returned(law, flow, s)
    assert (out[0] == s[0]).all()
    lifted = np.maximum(s[1:], 0.05)
    assert (out[1:] == returned(law, flow, lifted)[0]).all()


def test_uniaxial_yield_stress(d):
    """Uniaxial stress sigma_y, in 2D a difference of sigma_y, yields (X-cross-7, X-cross-15)."""
    tau = np.zeros(d)
    tau[0] = 3.0
    assert abs(size(deviator(tau)) - yield_radius(d, sigma_y=3.0)) < EPS
    assert yield_radius(d, tau_y=3.0) == 3.0
    for name in ("von_mises", "herschel_bulkley", "fixed_corotated_von_mises"):
        _, flow = setting(name, d, tau_y=None, sigma_y=3.0)
        assert flow.tau_y == yield_radius(d, sigma_y=3.0)


# Von Mises on fixed corotated elasticity: HOT-vonmises.

@pytest.mark.parametrize("spread", [0.02, 0.1, 0.2])
def test_hot_von_mises_lands_on_the_surface_and_its_volume_error_is_bounded(spread, d, rng):
    law, flow = setting("fixed_corotated_von_mises", d, tau_y=0.1)
    s = stretches(rng, d, spread)
    s = s[(s > 0.5).all(axis=1)]
    out, _, _ = returned(law, flow, s)
    trial = dev_tau(s, law)
    yields = trial > flow.tau_y
    assert yields.sum() > 50
    assert np.abs(dev_tau(out, law) - flow.tau_y)[yields].max() < 10 * EPS
    assert np.abs(mean_x(out) - mean_x(s)).max() < EPS      # the mean stress at frozen J
    growth = np.log(volume(out) / volume(s))[yields]
    z = s[yields].min(axis=1)
    G = (4 * z - 1) / (z**2 * (2 * z - 1) ** 3)
    bound = G / 2 * (trial[yields] ** 2 - flow.tau_y**2) / (2 * law.mu) ** 2
    assert (growth >= -EPS).all()
    assert (growth <= bound + EPS).all()
    assert (growth > 0.1 * bound).any()                     # and the bound is no idle one


def test_hot_von_mises_may_raise_the_energy_of_large_strains(d, rng):
    """The volume it creates is elastic, hence no dissipation is promised; 2 % of strain is fine."""
    law, flow = setting("fixed_corotated_von_mises", d, tau_y=0.1)
    small, large = stretches(rng, d, 0.02), stretches(rng, d, 0.2)
    ratio = [psi(returned(law, flow, s)[0], law) / psi(s, law) for s in (small, large)]
    assert ratio[0].max() <= 1 + EPS
    assert ratio[1].max() > 1.2


def mean_x(s):
    return (s * (s - 1)).mean(axis=1)


def test_hot_von_mises_on_aluminium(d):
    """HOT's metal at twice its yield stress: how much volume one return creates."""
    E, nu, sigma_y = 6.9e10, 0.33, 2.4e8
    mu, lam = E / (2 * (1 + nu)), E * nu / ((1 + nu) * (1 - 2 * nu))
    law = FixedCorotated(mu, lam)
    flow = make_flow("fixed_corotated_von_mises", law, d, sigma_y=sigma_y)
    x = np.zeros((1, d))
    x[0, :2] = 2 * flow.tau_y / (2 * mu) / sqrt(2) * np.array([1, -1])
    s = 0.5 + np.sqrt(0.25 + x)
    out, _, _ = returned(law, flow, s)
    growth = np.log(volume(out) / volume(s))[0]
    second_order = 3 / 2 * 3 * (flow.tau_y / (2 * mu)) ** 2
    assert abs(growth / second_order - 1) < 0.02
    assert 4e-5 < growth < 7e-5
