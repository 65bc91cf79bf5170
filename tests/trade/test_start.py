"""Settings whose particles represent a body badly at the start are told from the others."""

from types import SimpleNamespace

import pytest
from sweep_scenes import FLIGHT

from mpm_ref.scene import loads
from mpm_ref.sweep.setting import setting
from mpm_ref.trade.start import start_fault

BIN = """
dim = 2
dx = 0.025
end = 0.4
[[body]]
name = "clay"
density = 1600.0
shape = { type = "box", lower = [0.0, 0.0], upper = [0.3, 0.2] }
material = { law = "hencky", E = 2e5, nu = 0.4 }
"""


def fault_at(text, **knobs):
    search = SimpleNamespace(scene=loads(text), levels=(4.0, 2.0, 1.0, 0.5), others={})
    return start_fault(search, setting(**knobs))


def test_a_lost_layer_of_particles_is_told():
    """At 1.5 dx with one point per cell the box 0.2 m high has five layers of 0.0375 m."""
    fault = fault_at(BIN, dx=1.5, particles=0.5, cfl=0.9)
    assert "the centroid of body 'clay' along y lies at 0.09375 m, in the reference at 0.1 m" in (
        fault)
    assert "\n" not in fault


@pytest.mark.parametrize("knobs", [{"dx": 1.0}, {"dx": 2.0}, {"dx": 4.0}, {"cfl": 0.9, "dx": 1.0},
                                   {"dx": 2.0, "particles": 0.5}, {"dx": 1.0, "particles": 0.5},
                                   {"dx": 0.5}])
def test_settings_that_fill_the_body_have_no_fault(knobs):
    assert fault_at(BIN, **knobs) == ""


@pytest.mark.parametrize(("dx", "is_fault"), [(1.0, False), (1.5, False), (4.0, True)])
def test_a_disk_may_have_steps_less_than_two_fifths_of_a_cell(dx, is_fault):
    assert bool(fault_at(FLIGHT, dx=dx)) == is_fault


def test_the_body_that_is_off_most_is_named():
    second = BIN.partition("[[body]]")[2].replace("clay", "sand").replace("0.2]", "0.15]")
    fault = fault_at(BIN + "[[body]]" + second, dx=1.5, particles=0.5)
    assert "body 'clay'" in fault
    assert "sand" not in fault
