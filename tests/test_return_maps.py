"""Return maps, over the table of flows and d = 2, 3; expectations are written in NumPy."""

import re
from math import radians, sin, sqrt
from typing import NamedTuple

import numpy as np
import pytest
from constitutive import LAW, deviator, returned

from mpm_ref.materials import (
    FLOWS,
    FixedCorotated,
    Fluid,
    Hardening,
    Hencky,
    Material,
    NeoHookean,
    NoFlow,
    Softening,
    VonMises,
    make_flow,
    yield_radius,
)

TAU_Y = 0.4
EPS = 1e-13     # round-off of some dozen operations


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


def test_every_flow_of_the_table_is_tested():
    assert set(CASES) == set(FLOWS)


# What all flows have in common.

@pytest.mark.parametrize("name", CASES)
def test_rest_stays_at_rest(name, d):
    s, y, whole = returned(*setting(name, d), np.ones((1, d)), TAU_Y)
    assert (s == 1.0).all()
    assert y == TAU_Y
    assert whole == 1.0


@pytest.mark.parametrize("name", all_but("fluid_projection"))
def test_elastic_region_is_left_alone(name, d, rng):
    law, flow = setting(name, d)
    s = stretches(rng, d, 0.005)
    if name == "drucker_prager":
        s *= 0.98                       # the cone is under pressure
    assert dev_tau(s, law).max() < TAU_Y
    out, y, _ = returned(law, flow, s, TAU_Y)
    assert (out == s).all()
    assert (y == TAU_Y).all()


@pytest.mark.parametrize("name", all_but("von_mises_softening", "herschel_bulkley"))
def test_idempotent(name, d, rng):
    """Where the surface does not shrink and no time passes."""
    law, flow = setting(name, d)
    s, y, _ = returned(law, flow, stretches(rng, d), TAU_Y)
    again, _, _ = returned(law, flow, s, y)
    assert np.abs(again - s).max() < 10 * EPS


DILATES = "snow_clamp", "drucker_prager", "fixed_corotated_von_mises"


@pytest.mark.parametrize("name", all_but(*DILATES))
def test_volume_is_kept(name, d, rng):
    s = stretches(rng, d)
    out, _, whole = returned(*setting(name, d), s, 100.0 if "soft" in name else TAU_Y)
    assert whole.all()
    assert np.abs(volume(out) / volume(s) - 1).max() < EPS


@pytest.mark.parametrize("name", CASES)
def test_order_of_singular_values_does_not_matter(name, d, rng):
    law, flow = setting(name, d)
    s = stretches(rng, d)
    one, other = (returned(law, flow, a, TAU_Y)[0] for a in (s, s[:, ::-1]))
    assert np.abs(one - other[:, ::-1]).max() < EPS


@pytest.mark.parametrize("name", all_but("snow_clamp", "fixed_corotated_von_mises"))
def test_elastic_energy_never_grows(name, d, rng):
    law, flow = setting(name, d)
    s = stretches(rng, d)
    out, _, _ = returned(law, flow, s, TAU_Y)
    assert (psi(out, law) <= psi(s, law) * (1 + EPS)).all()
    if name not in ("none", "fluid_projection"):
        assert (psi(out, law) < 0.9 * psi(s, law)).any()


@pytest.mark.parametrize("name", ["drucker_prager", *VON_MISES])
def test_plastic_work_is_not_negative(name, d, rng):
    """tau : d eps_p >= 0, at the stress after the return."""
    law, flow = setting(name, d)
    s = stretches(rng, d)
    out, _, _ = returned(law, flow, s, TAU_Y)
    work = (kirchhoff_hat(out, law) * (np.log(s) - np.log(out))).sum(axis=1)
    assert (work >= -EPS).all()


@pytest.mark.parametrize("name", CASES)
def test_nan_stays_visible(name, d):
    s = np.full((1, d), np.nan)
    assert np.isnan(returned(*setting(name, d), s, TAU_Y)[0]).all()


@pytest.mark.parametrize("name", ["drucker_prager", *VON_MISES[:2], "herschel_bulkley",
                                  "fluid_projection"])
def test_inverted_state_is_passed_on(name, d):
    """These laws have no stress there; the run is told by it, not by an invented state."""
    s = np.ones((1, d))
    s[0, -1] = -0.5
    assert (returned(*setting(name, d), s, TAU_Y)[0] == s).all()


def test_no_flow_is_the_identity(d, rng):
    s = stretches(rng, d, 2.0)
    assert (returned(LAW["hencky"], NoFlow(), s)[0] == s).all()      # NCLAW-eq13


# Drucker-Prager: NSF-F3, NCLAW-eq15, NCLAW-eq16.

def test_drucker_prager_regions(d, rng):
    law, flow = setting("drucker_prager", d)
    s = stretches(rng, d)
    out, _, _ = returned(law, flow, s)
    tension = np.log(s).sum(axis=1) > 0
    assert (out[tension] == 1.0).all()                               # NCLAW-X7: tension wins
    tau = kirchhoff_hat(out, law)
    room = -flow.alpha * tau.sum(axis=1) - size(deviator(tau))       # >= 0 in the cone
    assert (room >= -10 * EPS).all()
    moved = ~tension & (out != s).any(axis=1)
    kept = ~tension & ~moved
    assert min(tension.sum(), moved.sum(), kept.sum()) > 5
    assert np.abs(room[moved]).max() < 10 * EPS                      # on the cone
    assert np.abs(volume(out[moved]) / volume(s[moved]) - 1).max() < EPS


def test_drucker_prager_return_is_radial(d, rng):
    law, flow = setting("drucker_prager", d)
    s = stretches(rng, d) * 0.8
    out, _, _ = returned(law, flow, s)
    kept = np.log(out).sum(axis=1) < 0
    before, after = deviator(np.log(s[kept])), deviator(np.log(out[kept]))
    cosine = (before * after).sum(axis=1) / (size(before) * size(after))
    assert np.abs(cosine - 1).max() < EPS


@pytest.mark.parametrize("angle", [20.0, 25.0, 40.0])
def test_drucker_prager_slope_is_mohr_coulomb(angle, d):
    """sigma_1 - sigma_3 = -(sigma_1 + sigma_3) sin(phi) at yield: in every state in 2D, in triaxial
    compression (sigma_1 = sigma_2 > sigma_3) in 3D."""
    alpha = make_flow("drucker_prager", LAW["hencky"], d, friction_angle=angle).alpha
    sine = sin(radians(angle))
    tau = np.array([-(1 - sine), -(1 + sine)] if d == 2 else [-(1 - sine)] * 2 + [-(1 + sine)])
    assert abs(size(deviator(tau)) + alpha * tau.sum()) < EPS


def test_drucker_prager_slopes_of_2d_and_3d_differ():
    """X-cross-15."""
    flat, full = (make_flow("drucker_prager", LAW["hencky"], d, friction_angle=30) for d in (2, 3))
    assert abs(flat.alpha - 0.5 / sqrt(2)) < EPS
    assert abs(full.alpha - sqrt(2 / 3) * 2 * 0.5 / 2.5) < EPS


def test_drucker_prager_at_the_axis(d):
    """No deviator, so that eps_hat / |eps_hat| is 0/0: compression stays, expansion goes to 1."""
    s = np.array([[0.7] * d, [1.3] * d])
    out, _, _ = returned(*setting("drucker_prager", d), s)
    assert (out[0] == s[0]).all()
    assert (out[1] == 1.0).all()


def test_least_stretch_recovers_inverted_sand(d):
    law, flow = setting("drucker_prager", d, s_min=0.05)
    s = np.full((2, d), 0.8)
    s[:, -1] = -0.5, 0.01
    out, _, _ = returned(law, flow, s)
    lifted, _, _ = returned(law, flow, np.where(s < 0.05, 0.05, s))
    assert (out == lifted).all()
    assert (out > 0).all()


# Von Mises: NSF-F4, NCLAW-eq18, NCLAW-eq19.

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


# Herschel-Bulkley: NSF-F5.

def b_bar(s):
    return s**2 * volume(s)[:, None] ** (-2 / s.shape[1])


def shear_stress(s, law):
    """`dev_tau` of the neo-Hookean law, without the round-off of its pressure."""
    return law.mu * size(deviator(b_bar(s)))


@pytest.mark.parametrize("spread", [0.3, 1.5])
def test_herschel_bulkley_closed_form(d, rng, spread):
    law, flow = setting("herschel_bulkley", d)
    s, dt = stretches(rng, d, spread), 0.7
    out, _, _ = returned(law, flow, s, dt=dt)
    trial = shear_stress(s, law)
    yields = trial > TAU_Y
    relaxed = trial - (trial - TAU_Y) / (1 + flow.eta / (2 * law.mu * dt))
    expected = np.where(yields, relaxed, trial)
    assert yields.sum() > 50
    # D + c I cancels in its smallest entry: round-off grows by the condition number of b_bar
    condition = (out.max(axis=1) / out.min(axis=1)) ** 2
    assert np.abs((volume(out) / volume(s) - 1) / condition).max() < 3 * EPS
    assert np.abs((shear_stress(out, law) / expected - 1) / condition).max() < 3 * EPS
    before, after = deviator(b_bar(s)), deviator(b_bar(out))
    cosine = (before * after).sum(axis=1) / (size(before) * size(after))
    assert np.abs(cosine - 1).max() < 1e-12
    assert (out > 0).all()


def test_herschel_bulkley_without_viscosity_is_perfect_plasticity(d, rng):
    law, flow = setting("herschel_bulkley", d, eta=0.0)
    s = stretches(rng, d)
    out, _, _ = returned(law, flow, s)
    assert np.abs(dev_tau(out, law) - np.minimum(dev_tau(s, law), TAU_Y)).max() < 10 * EPS
    again, _, _ = returned(law, flow, out)
    assert np.abs(again - out).max() < 10 * EPS


def test_herschel_bulkley_limit_of_infinite_viscosity_is_elastic(d, rng):
    law, flow = setting("herschel_bulkley", d, eta=1e12)
    s = stretches(rng, d)
    assert np.abs(returned(law, flow, s)[0] - s).max() < 1e-9


def test_herschel_bulkley_converges_to_exponential_relaxation(d, rng):
    """ds/dt = -2 mu (s - tau_y) / eta, of which one step is backward Euler: first order."""
    law, flow = setting("herschel_bulkley", d)
    start = stretches(rng, d)
    start = start[dev_tau(start, law) > TAU_Y][:20]
    time, errors, counts = 0.5, [], [20, 40, 80, 160]
    exact = TAU_Y + (dev_tau(start, law) - TAU_Y) * np.exp(-2 * law.mu * time / flow.eta)
    for n in counts:
        s = start
        for _ in range(n):
            s, _, _ = returned(law, flow, s, dt=time / n)
        errors.append(np.abs(dev_tau(s, law) - exact).max())
    assert -1.1 < np.polyfit(np.log(counts), np.log(errors), 1)[0] < -0.9


def test_herschel_bulkley_with_the_trace_kept_changes_volume(d, rng):
    """The usual c = tr(b_bar) / d, against the c with det b_bar = 1 that is used here."""
    law, flow = setting("herschel_bulkley", d, eta=0.0)
    s = stretches(rng, d, 0.1)
    s = s[dev_tau(s, law) > TAU_Y]
    trial = b_bar(s)
    D = deviator(trial) * (TAU_Y / dev_tau(s, law))[:, None]
    kept = D + trial.mean(axis=1, keepdims=True)
    assert volume(kept).max() > 1.01
    assert np.abs(volume(b_bar(returned(law, flow, s)[0])) - 1).max() < EPS


# Fluid projection: NCLAW-eq21. Snow: HOT-material.

def test_fluid_projection(d, rng):
    law, flow = setting("fluid_projection", d)
    s = stretches(rng, d)
    out, _, _ = returned(law, flow, s)
    assert np.abs(out - volume(s)[:, None] ** (1 / d)).max() < EPS
    assert np.abs(psi(out, law) - psi(s, law)).max() < 10 * EPS


def test_snow_clamp(d, rng):
    law, flow = setting("snow_clamp", d, s_min=0.99, s_max=1.001)
    s = stretches(rng, d)
    s[0, -1] = -1.0
    assert (returned(law, flow, s)[0] == np.clip(s, 0.99, 1.001)).all()


def test_snow_clamp_and_energy(d, rng):
    """Less energy without volume term; with a large one, a clamp may raise it."""
    s, flow = stretches(rng, d), setting("snow_clamp", d)[1]
    without = FixedCorotated(1.0, 0.0)
    assert (psi(returned(without, flow, s)[0], without) <= psi(s, without)).all()
    stiff = FixedCorotated(1.0, 1e3)
    s = np.array([[1.1, 1 / 1.1] if d == 2 else [1.1, 1.0, 1 / 1.1]])
    assert psi(returned(stiff, flow, s)[0], stiff) > psi(s, stiff)


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


# Parameters and the summary.

@pytest.mark.parametrize(("name", "parameters", "said"), [
    ("mohr_coulomb", {}, "flow 'mohr_coulomb': expected one of none, drucker_prager, von_mises"),
    ("none", {"tau_y": 1}, "flow 'none': unknown parameter tau_y; its parameters are: none"),
    ("drucker_prager", {}, "flow 'drucker_prager': missing parameter friction_angle"),
    ("drucker_prager", {"friction_angle": 90}, "friction_angle = 90: expected degrees"),
    ("drucker_prager", {"friction_angle": np.nan}, "friction_angle = nan"),
    ("drucker_prager", {"friction_angle": 30, "s_min": 1}, "s_min = 1: expected 0 <= s_min < 1"),
    ("drucker_prager", {"friction_angle": 30, "dim": 3}, "unknown parameter dim"),
    ("von_mises", {}, "expected one of them: sigma_y is the uniaxial yield stress"),
    ("von_mises", {"sigma_y": 1, "tau_y": 1}, "expected one of them"),
    ("von_mises", {"sigma_y": 0}, "sigma_y = 0: expected a finite number > 0"),
    ("von_mises", {"tau_y": np.inf}, "tau_y = inf"),
    ("von_mises_hardening", {"tau_y": 1, "xi": -1}, "xi = -1: expected a finite number >= 0"),
    ("von_mises_softening", {"tau_y": 1, "theta": -1}, "theta = -1"),
    ("herschel_bulkley", {"tau_y": 1, "eta": 1}, "on the law Hencky: expected NeoHookean"),
    ("fluid_projection", {}, "on the law Hencky: expected Fluid"),
    ("snow_clamp", {"s_min": 0.9, "s_max": 0.99}, "expected 0 < s_min <= 1 <= s_max"),
    ("snow_clamp", {"s_min": 0.9, "s_max": np.inf}, "s_max = inf"),
])
def test_bad_flows_are_refused_in_a_sentence(name, parameters, said):
    with pytest.raises(ValueError, match=re.escape(said)):
        make_flow(name, LAW["hencky"], 3, **parameters)


def test_flows_of_log_strain_are_refused_on_other_laws():
    """X-cross-13."""
    for name in ("drucker_prager", *VON_MISES):
        with pytest.raises(ValueError, match="FixedCorotated: expected Hencky, in whose strain"):
            make_flow(name, LAW["fixed_corotated"], 3, **CASES[name].parameters)


def test_flow_in_four_dimensions_is_refused():
    with pytest.raises(ValueError, match="dim = 4: expected 2 or 3"):
        make_flow("none", LAW["hencky"], 4)


def test_material_says_what_a_body_needs():
    hencky, fluid = LAW["hencky"], LAW["fluid"]
    assert not Material(fluid, NoFlow()).needs_F
    assert Material(fluid, make_flow("fluid_projection", fluid, 3)).needs_F
    assert Material(hencky, NoFlow()).needs_F
    assert not Material(hencky, VonMises(1.0, 0.0)).has_history
    for flow in (Hardening(0.7, 0.1, 0.0), Softening(0.7, 0.1, 0.0)):
        assert Material(hencky, flow).has_history
        assert Material(hencky, flow).initial_y == 0.7
    assert Material(hencky, NoFlow()).initial_y == 0.0
    assert abs(Material(Fluid(8.0), NoFlow()).wave_speed(2.0) - 2.0) < EPS
