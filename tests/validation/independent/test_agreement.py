"""The measure of agreement."""

import numpy as np
import pytest

from validation.independent.agreement import difference


def test_differences_are_of_the_largest_entries():
    assert difference([1.0, 2.5], [1.0, 2.0]) == pytest.approx(0.25)
    assert difference([1.0, 2.5], [1.0, 2.0], [0.0, 5.0]) == pytest.approx(0.1)


@pytest.mark.parametrize("other", [[1.0, np.nan], [1.0, 2.0, 3.0], [[1.0], [2.0]]])
def test_nothing_agrees_with_nan_and_other_shapes(other):
    assert difference(other, [1.0, 2.0]) == np.inf
