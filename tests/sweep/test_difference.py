import numpy as np
import pytest

from mpm_ref.sweep.difference import (
    change_so_far,
    difference_so_far,
    largest_change,
    relative_difference,
)


def test_change_is_the_largest_since_the_start():
    values = np.array([[1.0, 1.0], [1.0, 3.0], [1.0, 1.0], [5.0, 4.0]])
    assert change_so_far(values) == pytest.approx([0.0, 2.0**0.5, 2.0**0.5, 12.5**0.5])
    assert largest_change(values) == pytest.approx(12.5**0.5)


@pytest.mark.parametrize(("value", "change"), [(7.0, 7.0), (-7.0, 7.0), (0.0, 1.0)])
def test_what_never_changes_is_compared_with_its_size(value, change):
    assert largest_change(np.full((4, 1), value)) == change
    assert largest_change(value * (1.0 + 1e-12 * np.arange(4.0)[:, None])) == pytest.approx(change)


def test_runs_with_other_numbers_do_not_compare():
    assert np.isnan(relative_difference(np.zeros((3, 1)), np.zeros((3, 2)), 1.0)).all()
    assert np.isinf(difference_so_far(np.zeros((3, 1)), np.zeros((3, 2)))).all()


def test_differences_grow_and_stay_unknown_after_a_stop():
    values = np.array([[0.0], [2.0], [1.0], [np.nan], [0.0]])
    assert difference_so_far(values, np.zeros((5, 1))) == pytest.approx([0, 2, 2, np.inf, np.inf])
