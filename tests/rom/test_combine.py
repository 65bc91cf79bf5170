"""Sums of modes at chosen points."""

import numpy as np
import pytest
from problems import run_python
from threads import by_threads

from mpm_ref.rom.fields.pod_fields import combined

UNCOMPILED = """
import json
import numpy as np
from mpm_ref.rom.fields.pod_fields import combined
modes = np.arange(6000.0).reshape(500, 3, 4)
print(json.dumps(combined(modes, np.arange(500), np.array([1.0, 2.0, 3.0, 4.0])).tolist()))
"""


def four_sums(modes, points, a):
    """The sums in plain NumPy: of every fourth term, one by one, what is left to the first; then
    two by two."""
    sums, fours = np.zeros((4, len(points), modes.shape[1])), len(a) - len(a) % 4
    for r in range(len(a)):
        sums[r % 4 if r < fours else 0] += modes[points, :, r].astype(float) * a[r]
    return (sums[0] + sums[1]) + (sums[2] + sums[3])


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


@pytest.mark.parametrize("digits", [np.float64, np.float32])
@pytest.mark.parametrize(("values", "count"), [(2, 3), (3, 20), (9, 41)])
def test_has_the_bits_of_plain_sums_for_any_number_of_threads(values, count, digits, rng):
    modes, a = rng.normal(size=(3000, values, count)).astype(digits), rng.normal(size=count)
    points = rng.permutation(3000)[:2500]
    for found in by_threads(lambda: combined(modes, points, a)):
        assert np.array_equal(found, four_sums(modes, points, a))


def test_reads_nothing_ahead_where_nothing_is_compiled():
    modes = np.arange(6000.0).reshape(500, 3, 4)
    found = run_python(UNCOMPILED, NUMBA_DISABLE_JIT="1")
    assert np.array_equal(found, combined(modes, np.arange(500), np.array([1.0, 2.0, 3.0, 4.0])))
