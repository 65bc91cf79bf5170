"""The tables of laws and flows, and what they refuse."""

import re

import numpy as np
import pytest
from constitutive import EPS, LAW, close
from flows import CASES

from mpm_ref.materials import (
    Fluid,
    Hardening,
    Material,
    NoFlow,
    Softening,
    VonMises,
    bulk_modulus,
    lame,
    make_flow,
    make_law,
    recovers,
)


def test_moduli():
    """NSF-F0; the water of NCLAW-mat has a lam only."""
    mu, lam = lame(2.6, 0.3)
    assert close(mu, 1.0)
    assert close(lam, 1.5)
    assert close(bulk_modulus(2.6, 0.3), lam + 2.0 / 3.0 * mu)
    assert close(bulk_modulus(2.6, 0.3), 2.6 / (3 * (1 - 0.6)))
    assert make_law("fluid", lam=3) == Fluid(3.0)
    assert make_law("fluid", E=1e5, nu=0.3).lam == lame(1e5, 0.3)[1]


@pytest.mark.parametrize(("name", "parameters", "said"), [
    ("elastic", {}, "law 'elastic': expected one of fixed_corotated, hencky, neo_hookean"),
    ("hencky", {"E": 1}, "law 'hencky': missing parameter nu"),
    ("hencky", {"E": 1, "nu": 0.2, "rho": 3}, "unknown parameter rho; its parameters are: E, nu"),
    ("hencky", {"E": 0, "nu": 0.2}, "E = 0: expected a finite number > 0"),
    ("neo_hookean", {"E": -1, "nu": 0.2}, "E = -1"),
    ("fixed_corotated", {"E": np.nan, "nu": 0.2}, "E = nan"),
    ("fixed_corotated", {"E": np.inf, "nu": 0.2}, "E = inf"),
    ("fixed_corotated", {"E": 1, "nu": 0.5}, "nu = 0.5: expected -1 < nu < 0.5; take 0.49"),
    ("fixed_corotated", {"E": 1, "nu": -1}, "nu = -1"),
    ("fixed_corotated", {"E": 1, "nu": np.nan}, "nu = nan"),
    ("fluid", {}, "expected the bulk modulus lam, or both E and nu"),
    ("fluid", {"lam": 1, "E": 1, "nu": 0.2}, "expected the bulk modulus lam, or both E and nu"),
    ("fluid", {"E": 1}, "expected the bulk modulus lam, or both E and nu"),
    ("fluid", {"E": 1, "nu": 0}, "lam = 0.0: expected a finite number > 0"),
])
def test_bad_parameters_are_refused_in_a_sentence(name, parameters, said):
    with pytest.raises(ValueError, match=re.escape(said)):
        make_law(name, **parameters)


def test_only_fixed_corotated_recovers():
    assert [name for name, law in LAW.items() if recovers(law)] == ["fixed_corotated"]


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
    for name in ("drucker_prager", "von_mises", "von_mises_hardening"):
        with pytest.raises(ValueError, match="FixedCorotated: expected Hencky, which it is"):
            make_flow(name, LAW["fixed_corotated"], 3, **CASES[name].parameters)


@pytest.mark.parametrize("law", ["neo_hookean", "log_neo_hookean", "fluid"])
def test_softening_is_for_hencky_and_fixed_corotated_alone(law):
    with pytest.raises(ValueError, match="expected Hencky or FixedCorotated, which it is written"):
        make_flow("von_mises_softening", LAW[law], 3, tau_y=1.0, theta=0.1)


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
