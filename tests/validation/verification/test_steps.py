"""The formulas of the experiment on the number of steps; the experiment itself is not run."""

from math import cos, pi, sin

import numpy as np
import pytest

from mpm_ref.explicit import Scheme
from mpm_ref.scene.crossing import crossing_time
from validation.verification.bar import OMEGA, V
from validation.verification.mode_decay import CELLS, amplification, expected_rate, measured_rate
from validation.verification.rotation import disk
from validation.verification.sand_column import SandColumn, column_scene
from validation.verification.steps import ALL, MLS, TransferChoice, bar_between, euler_vibration

MANY = 1000         # particles per cell: in place of an integral over the cell


@pytest.mark.parametrize("theta", [0.1, 1.0, 2.5])
def test_amplification_of_pic_is_the_sum_of_quintic_splines(theta):
    closed = (33.0 + 26.0 * cos(theta) + cos(2.0 * theta)) / 60.0
    assert amplification(2, False, MANY, theta) == pytest.approx(closed, abs=1e-6)


@pytest.mark.parametrize(("degree", "factor"), [(2, 1.0 / 42.0), (3, 17.0 / 360.0)])
def test_affine_transfers_damp_long_waves_with_the_fourth_power(degree, factor):
    loss = 1.0 - amplification(degree, True, MANY, 0.05)
    assert loss / 0.05**4 == pytest.approx(factor, rel=2e-3)


@pytest.mark.parametrize("scheme", [
    Scheme(2, "mls"), Scheme(3, "apic"), Scheme(2, "flip", flip=0.9), Scheme(2, "pic"),
    Scheme(2, "mls", relaxation=3.0), Scheme(3, "apic", relaxation=0.5)],
    ids=lambda scheme: f"{scheme.transfer}{scheme.degree}-{scheme.relaxation:g}")
def test_modes_decay_as_the_formula_says(scheme):
    for waves in (1, 2):
        theta = 2.0 * pi * waves / CELLS
        expected = expected_rate(scheme, 2, theta)
        assert measured_rate(scheme, 2, waves, 5) == pytest.approx(expected, rel=1e-5)


def test_decay_per_time_has_a_limit_for_short_steps():
    """It is (1 - T)/relaxation; without relaxation the rate belongs to the step."""
    limit = (1.0 - amplification(2, True, 2, 0.4)) / 3.0
    for dt in (1e-2, 1e-4):
        rate = expected_rate(Scheme(relaxation=3.0), 2, 0.4, dt) / dt
        assert rate == pytest.approx(limit, rel=dt)
    assert expected_rate(Scheme(), 2, 0.4, 1e-4) == expected_rate(Scheme(), 2, 0.4, 0.1)


def test_vibration_of_symplectic_euler_steps():
    dt = 0.3 / OMEGA
    omega, size = euler_vibration(dt)
    u, v = 0.0, V * cos(0.5 * OMEGA * dt)
    for k in range(50):
        v -= dt * OMEGA**2 * u
        u += dt * v
        assert u == pytest.approx(size * sin(omega * (k + 1) * dt), abs=1e-12 * V / OMEGA)


def test_crossing_times_are_those_of_the_stiffest_body():
    scene = disk("mls", 1)
    assert crossing_time(scene) == pytest.approx(0.1 / np.sqrt(1e4 * 0.7 / (1.3 * 0.4) / 1000.0))
    relaxed = column_scene(SandColumn(2, 1.0, 4, "mls", crossings=2.0))
    assert relaxed.scheme.relaxation == pytest.approx(2.0 * crossing_time(relaxed))


def test_names_and_bodies_of_the_choices():
    assert len({choice.name for choice in ALL}) == len(ALL)
    assert (MLS.name, TransferChoice("apic", 1.0, 3).name) == ("mls", "apic-relaxed-cubic")
    body, X, stepper = bar_between(0.0, 4, TransferChoice("mls", 1.0))
    assert body.particles.L is not body.particles.C
    assert len(X) == len(body.id) == 16
    assert stepper.scheme.relaxation > 0.0
