"""The adjoint of a step of deformation, over the tables of laws and flows and d = 2, 3.

The numbers come from a process without compilation, see `deform_bars`; that the compiled loops give
the same is tested in test_adjoint_deform_compiled.
"""

import pytest
from constitutive import EPS, LAW
from deform_bars import GAPS, families, materials
from flows import CASES
from problems import run_python

from mpm_ref.materials import FLOWS, LAWS, SnowClamp

CODE = """
import json
from deform_bars import measured
print(json.dumps({d: measured(d) for d in (2, 3)}))
"""
NAMES = list(materials(2))
BRANCHES = {
    "drucker_prager": {"all", "part", "none"},
    "von_mises": {"all", "part"},
    "von_mises_hardening": {"all", "part"},
    "von_mises_softening": {"all", "part", "none"},         # none: the particle has failed
    "herschel_bulkley": {"all", "part"},
    "fixed_corotated_von_mises": {"all", "part"},
    "fluid_projection": {"none"},
    "fluid of J": set(),
}


@pytest.fixture(scope="module")
def measured():
    return run_python(CODE, NUMBA_DISABLE_JIT="1")


@pytest.fixture(params=NAMES)
def found(request, measured, d):
    return measured[str(d)][request.param]


def is_second_order(orders):
    """Complaints about fitted orders of remainders; None stands for mere round-off."""
    return {(key, name): order for key, of_names in orders.items()
            for name, order in of_names.items() if order is not None and not 1.9 < order < 2.1}


def test_every_law_and_flow_of_the_tables_is_measured(d):
    laws = {type(law) for law, _, _ in materials(d).values()}
    flows = {type(flow) for _, flow, _ in materials(d).values()}
    assert laws == {type(law) for law in LAW.values()}
    assert set(LAW) == set(LAWS)
    assert set(CASES) == set(FLOWS)
    assert len(flows) == len(FLOWS)


def test_gradients_of_a_step(found):
    assert not is_second_order(found["orders"])


def test_gradients_of_the_stress_at_the_start(found):
    assert not is_second_order(found["orders at start"])


@pytest.mark.parametrize("name", NAMES)
def test_remainders_are_seen(measured, d, name):
    """All but the moduli of an elastic step, which are linear, have a second-order remainder."""
    law, flow, _ = materials(d)[name]
    orders = measured[str(d)][name]["orders"]
    assert set(orders) == set(families(name, law))
    assert orders["random"]["F"] is not None
    assert orders["random"]["L"] is not None
    if isinstance(flow, SnowClamp):
        assert orders["random"]["s_min"] is not None
        assert orders["random"]["s_max"] is not None
    if name in ("drucker_prager", "von_mises"):
        assert orders["singular"]["s_min"] is not None


@pytest.mark.parametrize("name", NAMES)
def test_every_branch_of_the_return_map_is_taken(measured, d, name):
    assert set(measured[str(d)][name]["branches"]) == BRANCHES.get(name, {"all"})


@pytest.mark.parametrize("name", [name for name in BRANCHES if "part" in BRANCHES[name]])
def test_gradients_at_the_yield_surface_are_those_of_either_side(measured, d, name):
    orders = measured[str(d)][name]["at yield"]
    assert 1.9 < orders["inwards"] < 2.1
    assert 1.9 < orders["outwards"] < 2.1
    assert 0.9 < orders["across"] < 1.1


def test_objectivity_and_isotropy(found):
    assert found["turned"] < 10 * EPS


def test_gradients_are_smooth_where_singular_values_meet(found):
    slope = found["gaps"][1] / GAPS[1]
    assert slope > 0.01
    for gap, change in zip(GAPS, found["gaps"]):
        assert abs(change - slope * gap) < 1e-2 * slope * gap + EPS
