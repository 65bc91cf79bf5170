"""Herschel-Bulkley with h = 1: NSF-F5."""

import numpy as np
import pytest
from constitutive import EPS, deviator, returned
from flows import TAU_Y, dev_tau, setting, size, stretches, volume


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
