"""Return maps, over the table of flows and d = 2, 3; expectations are written in NumPy."""

import numpy as np
import pytest
from constitutive import EPS, LAW, returned
from flows import (
    CASES,
    TAU_Y,
    VON_MISES,
    all_but,
    dev_tau,
    kirchhoff_hat,
    psi,
    setting,
    stretches,
    volume,
)

from mpm_ref.materials import FLOWS, FixedCorotated, NoFlow


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
