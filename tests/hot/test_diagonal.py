"""Diagonal blocks of the Hessian without the matrix, against the matrix."""

import numpy as np
import pytest
from hot_cases import CASES, MLS, problem_of

from mpm_ref.hot.multigrid.projectors import diagonal_blocks


@pytest.mark.parametrize("case", [CASES[0], CASES[2], MLS[1]], ids=lambda case: case.name)
def test_blocks_are_those_of_the_matrix(case):
    q = problem_of(case)
    tangent = q.potential.tangent(q.dv)
    D = tangent.diagonal()
    expected = diagonal_blocks(tangent.matrix())
    size = np.abs(expected).max(axis=(1, 2), keepdims=True)
    assert np.abs((D - expected) / size).max() < 1e-12
    assert np.array_equal(D, np.swapaxes(D, 1, 2))
