"""Hints to read memory ahead."""

import numba
import numpy as np
import pytest

from mpm_ref.core.prefetch import prefetch


@pytest.mark.parametrize("digits", [np.float64, np.float32])
def test_a_kernel_gives_the_hint_and_no_more(digits):
    @numba.njit
    def hint(a, start):
        prefetch(a, start)

    a = np.arange(24, dtype=digits).reshape(2, 3, 4)
    assert hint(a, 5) is None
    assert np.array_equal(a.ravel(), np.arange(24))
    (text,) = hint.inspect_llvm().values()
    assert "@llvm.prefetch" in text


def test_an_address_that_does_not_exist_is_ignored():
    @numba.njit
    def hint(a, start):
        prefetch(a, start)
        return a[0]

    assert [hint(np.ones(3), start) for start in (-1, 3, 2**40, -2**40)] == [1.0] * 4
