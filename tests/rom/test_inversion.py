"""Where Gauss-Newton of NSF's inversion ends."""

from types import SimpleNamespace

import numpy as np
import pytest
from rom_toys import decoder

from mpm_ref.rom.kinematics import Kinematics
from mpm_ref.rom.latent import Latent
from mpm_ref.rom.projection import PositionInversion, project_position

START, END = np.array([0.7, 0.5, 0.6]), np.array([0.9, 0.4, 0.7])


class Scaled:
    """A map whose lengths and latent coordinates are so many times as large."""

    r = 3

    def __init__(self, map, scale):
        self.map, self.scale = map, scale

    def place(self, X, xhat):
        return self.scale * self.map.place(X, xhat / self.scale)

    def derivatives(self, X, xhat):
        x, _, G = self.map.derivatives(X, xhat / self.scale)
        return self.scale * x, None, G


def inverted(tolerance, scale=1.0):
    """The `Fit` of positions that belong to END, from START, all lengths scaled."""
    X, map = np.random.default_rng(0).uniform(size=(50, 3)), Scaled(decoder(3, 3), scale)
    trial = SimpleNamespace(x=map.place(X, scale * END))
    invert = PositionInversion(tolerance=tolerance)
    return invert(map, Latent(scale * START), Kinematics(X, X), trial, 1.0).fit


def test_it_ends_sooner_with_a_larger_tolerance_and_is_as_far_off_at_most():
    tolerances = (None, 1e-9, 1e-4, 1e-1)
    fits = [inverted(tolerance) for tolerance in tolerances]
    assert all(fit.converged for fit in fits)
    iterations = [fit.iterations for fit in fits]
    assert iterations == sorted(iterations, reverse=True)
    assert iterations[0] > iterations[2] > iterations[3]
    for tolerance, fit in zip(tolerances, fits, strict=True):
        assert np.abs(fit.y - END).max() <= max(1e-14, tolerance or 0.0)


def test_without_a_tolerance_it_ends_as_any_projection_of_positions():
    X, map = np.random.default_rng(0).uniform(size=(50, 3)), decoder(3, 3)
    fit = project_position(map, X, map.place(X, END), START)
    assert np.array_equal(inverted(None).y, fit.y)
    assert inverted(None).iterations == fit.iterations


@pytest.mark.parametrize("scale", [2.0**-20, 2.0**20])
def test_a_tolerance_is_relative_whatever_the_unit_of_length(scale):
    fit, other = inverted(1e-6), inverted(1e-6, scale)
    assert other.iterations == fit.iterations
    assert np.array_equal(other.y / scale, fit.y)


@pytest.mark.parametrize("tolerance", [0.0, -1e-6, np.nan, np.inf])
def test_a_tolerance_that_ends_nothing_or_all_is_refused(tolerance):
    with pytest.raises(ValueError, match=r"inversion_tolerance = .*: expected a positive number"):
        PositionInversion(tolerance=tolerance)


def test_one_step_has_no_tolerance():
    with pytest.raises(ValueError, match="inversion_tolerance = 1e-06: expected none with"):
        PositionInversion("linear", 1e-6)
