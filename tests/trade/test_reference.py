import numpy as np
import pytest

from mpm_ref.trade.reference import reference_of, reliable_times

T = np.linspace(0.0, 1.0, 11)
EXACT = np.stack((np.sin(T), T**2), axis=1)


def levels(order, n=4, size=0.1):
    """Values on n halved grids with an error of a given order that grows in time."""
    pattern = np.stack((T, -(T**2)), axis=1)
    return [EXACT + size * 2.0 ** (-order * k) * pattern for k in range(n)]


@pytest.mark.parametrize("order", [0.8, 1.0, 1.7, 2.0])
def test_order_is_observed_and_the_error_vanishes(order):
    reference = reference_of(levels(order))
    assert reference.order[1:] == pytest.approx(order)
    assert reference.values == pytest.approx(EXACT, abs=1e-12)


def test_error_estimate_bounds_the_error_of_the_finest_grid():
    runs = levels(1.0)
    reference = reference_of(runs)
    finest = np.sqrt(np.mean((runs[-1] - EXACT) ** 2, axis=1))[1:] / reference.scale[1:]
    assert (reference.error[1:] >= finest).all()
    assert reference.error[-1] == pytest.approx(1.25 * finest[-1], rel=1e-6)


def test_orders_that_disagree_are_not_extrapolated():
    pattern = levels(1.0)[0] - EXACT
    *_, finest = wobbling = [EXACT + share * pattern for share in (1.0, 0.55, 0.1, 0.0)]
    reference = reference_of(wobbling)
    assert (reference.values == finest).all()
    assert reference.error[-1] == pytest.approx(3.0 * reference.differences[-1], rel=1e-6)


def test_an_order_above_two_is_not_believed():
    runs = levels(4.0)
    reference = reference_of(runs)
    assert reference.order[-1] == pytest.approx(4.0)
    assert reference.error[-1] == pytest.approx(1.25 / 3.0 * reference.differences[-1])


def test_an_order_of_three_grids_that_is_too_large_is_an_accident():
    reference = reference_of(levels(4.0, n=3))
    assert reference.error[-1] == pytest.approx(3.0 * reference.differences[-1])
    assert (reference.values == levels(4.0, n=3)[-1]).all()
    safe = reference_of(levels(2.9, n=3))
    assert safe.error[-1] == pytest.approx(1.25 / 3.0 * safe.differences[-1])


@pytest.mark.parametrize("order", [0.3, 0.1, -0.5])
def test_without_convergence_the_error_is_three_times_the_spread(order):
    runs = levels(order)
    reference = reference_of(runs)
    assert (reference.values == runs[-1]).all()
    assert reference.error[-1] == pytest.approx(3.0 * max(reference.differences[-2:]))


def test_two_grids_have_no_order():
    assert np.isinf(reference_of(levels(1.0, n=2)).error[1:]).all()


def test_equal_runs_are_exact():
    reference = reference_of([EXACT, EXACT, EXACT])
    assert (reference.error[1:] == 1e-12).all()


def test_differences_of_round_off_are_no_spread():
    noise = 1e-13 * (EXACT - EXACT[0])
    reference = reference_of([EXACT + 1e9 * noise, EXACT, EXACT + noise])
    assert (reference.error[1:] == 1e-12).all()
    assert reliable_times([reference], 0.01)[1:].all()


def test_nothing_is_known_at_the_start():
    assert not reliable_times([reference_of(levels(1.0))], 1e9)[0]


def test_reliable_times_are_those_of_all_references():
    good, bad = reference_of(levels(1.0)), reference_of(levels(1.0, size=0.2))
    error = bad.error[5]
    assert reliable_times([good], error).sum() > reliable_times([good, bad], error).sum() > 0
    assert (reliable_times([good, bad], error) == reliable_times([bad], error)).all()


def test_errors_are_relative_to_the_change_so_far():
    reference = reference_of(levels(1.0))
    twice = EXACT + 0.1 * np.maximum.accumulate(np.abs(EXACT - EXACT[0]))
    assert reference.error_of(twice)[1:] == pytest.approx(0.1, rel=0.3)


def test_an_error_at_the_end_forgets_what_was_before():
    reference, values = reference_of(levels(1.0)), EXACT.copy()
    values[4] += 1.0
    assert reference.error_of(values)[-1] > 0.1
    assert reference.error_of(values, at_end=True)[-1] < 1e-9


def test_a_run_that_stopped_has_an_infinite_error_from_there():
    reference, values = reference_of(levels(1.0)), EXACT.copy()
    values[5:] = np.nan
    error = reference.error_of(values)
    assert np.isfinite(error[1:5]).all()
    assert np.isinf(error[5:]).all()


def test_another_estimate_can_only_raise_the_error():
    reference = reference_of(levels(1.0))
    raised = reference.raised(np.full(len(T), 0.5))
    assert (raised.error >= reference.error).all()
    assert raised.error[3] == 0.5
    assert (reference.raised(np.zeros(len(T))).error == reference.error).all()
