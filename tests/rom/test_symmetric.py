"""Symmetric tensors and their independent values."""

import numpy as np
import pytest

from mpm_ref.rom.symmetric import tensor, values


@pytest.mark.parametrize("lead", [(), (7,), (4, 0), (2, 5)])
def test_tensors_have_their_values_on_both_sides(lead, d, rng):
    a = rng.normal(size=(*lead, d * (d + 1) // 2))
    full = tensor(a, d)
    assert full.shape == (*lead, d, d)
    assert np.array_equal(full, np.swapaxes(full, -1, -2))
    assert np.array_equal(values(full), a)


def test_tensors_of_single_values_are_double(d, rng):
    a = rng.normal(size=(7, d * (d + 1) // 2)).astype(np.float32)
    assert tensor(a, d).dtype == float
    assert np.array_equal(values(tensor(a, d)), a)
