"""The bar of Figure 20 by the length of its steps: times of energies, and lengths that are kept."""

import numpy as np
import pytest

from validation.hot.step_length import BarRun, bar_run, time_of


def run_of(kinetic):
    """A run of three steps of 0.1 s with some kinetic energies."""
    t = np.array([0.1, 0.2, 0.3])
    return BarRun(1e5, 10, np.ones(3), t, np.array(kinetic), np.zeros(3), True)


@pytest.mark.parametrize(("value", "t"), [(0.5, 0.05), (1.0, 0.1), (2.0, 0.15), (4.0, 0.25)])
def test_an_energy_is_passed_between_two_steps(value, t):
    assert time_of(run_of([1.0, 3.0, 5.0]), "kinetic", value) == pytest.approx(t)


def test_an_energy_that_is_not_reached_has_no_time():
    assert np.isnan(time_of(run_of([1.0, 3.0, 5.0]), "kinetic", 6.0))
    assert np.isnan(time_of(run_of([1.0, 3.0, 5.0]), "elastic", 1e-9))


def test_steps_have_the_length_asked_for():
    run, particles = bar_run(1e5, 240, 0.06, 3)
    assert run.t == pytest.approx(np.arange(1, 4) / 240.0)
    assert particles == 3 * 240
    assert run.converged
    assert run.mean == run.iterations.mean() > 0.0
