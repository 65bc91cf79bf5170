"""Sums of modes at chosen points."""

import numpy as np
import pytest

from mpm_ref.rom.fields.pod_fields import combined


@pytest.mark.parametrize("count", [1, 3, 4, 6, 41])
def test_equals_the_product_of_arrays(count):
    rng = np.random.default_rng(count)
    modes, a = rng.normal(size=(50, 6, count)), rng.normal(size=count)
    points = rng.choice(50, 30, replace=False)
    assert np.abs(combined(modes, points, a) - modes[points] @ a).max() < 1e-13
    single = combined(modes.astype(np.float32), points, a)
    assert np.abs(single - modes[points] @ a).max() < 1e-5


def test_no_point():
    assert combined(np.ones((5, 3, 2)), np.zeros(0, dtype=int), np.ones(2)).shape == (0, 3)


def test_a_point_has_the_same_bits_alone_as_among_others():
    rng = np.random.default_rng(0)
    modes, a = rng.normal(size=(300, 9, 40)), rng.normal(size=40)
    alone = [combined(modes, [p], a)[0] for p in range(300)]
    assert np.array_equal(combined(modes, np.arange(300), a), alone)


def test_another_number_of_coefficients_is_refused():
    with pytest.raises(ValueError, match="3 coefficients for 2 modes: expected as many"):
        combined(np.ones((5, 3, 2)), np.arange(2), np.ones(3))
