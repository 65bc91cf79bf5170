"""The exact solutions of `verification.surface`, and the decision whether a bar is held."""

from math import pi

import numpy as np
import pytest
from scipy.optimize import brentq

from mpm_ref.core.boundary import Conditions
from mpm_ref.core.surface import SurfaceConditions
from validation.verification.surface import (
    AMPLITUDE,
    INNER,
    OUTER,
    Placement,
    bar_frequency,
    bracket,
    bracket_slope,
    polar_lattice,
    ring_mode,
)

K = brentq(bracket, 5.0, 7.5, args=(OUTER,))
SCHEME = ("mls", 2, 2)


def test_the_ring_is_at_rest_on_both_walls_alone():
    r = np.linspace(INNER, OUTER, 51)
    assert bracket(K, r[[0, -1]]) == pytest.approx(0.0, abs=1e-12)
    assert abs(bracket(K, r[1:-1])).min() > 1e-3


def test_the_mode_solves_the_wave_equation_of_a_ring():
    """u'' + u'/r - u/r^2 + k^2 u = 0, by differences."""
    r, h = np.linspace(INNER + 0.05, OUTER - 0.05, 9), 1e-4
    u = [bracket(K, r + step) for step in (-h, 0.0, h)]
    left = (u[0] - 2.0 * u[1] + u[2]) / h**2 + (u[2] - u[0]) / (2.0 * h * r) - u[1] / r**2
    assert left + K**2 * u[1] == pytest.approx(0.0, abs=1e-4)
    assert (u[2] - u[0]) / (2.0 * h) == pytest.approx(bracket_slope(K, r), abs=1e-6)


def test_the_velocity_gradient_is_that_of_the_velocity():
    X, h = np.array([[0.9, 0.2], [-0.5, 0.8]]), 1e-6
    v, growth = ring_mode(X, K, 2.0)
    assert np.abs(v).max() <= 2.0 * AMPLITUDE
    for axis in range(2):
        step = h * np.eye(2)[axis]
        slope = (ring_mode(X + step, K, 2.0)[0] - ring_mode(X - step, K, 2.0)[0]) / (2.0 * h)
        assert growth[:, :, axis] == pytest.approx(slope, abs=1e-8)


def test_the_points_fill_the_ring():
    X, areas = polar_lattice(0.05)
    r = np.hypot(*X.T)
    assert areas.sum() == pytest.approx(pi * (OUTER**2 - INNER**2))
    assert INNER < r.min() < r.max() < OUTER


def test_a_plane_between_nodes_holds_a_bar_at_its_surface_and_hardly_at_nodes():
    place = Placement(0.0, 0.8)
    assert abs(bar_frequency(SCHEME, 8, place, SurfaceConditions)) < 0.01
    assert bar_frequency(SCHEME, 8, place, Conditions) < -0.3
