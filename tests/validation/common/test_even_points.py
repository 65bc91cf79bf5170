"""Points that pictures show are spread evenly over the body."""

import numpy as np
from scipy.spatial import cKDTree

from validation.common.even_points import even_subset


def test_points_that_are_shown_are_spread_evenly():
    """No point of the lattice is far from a chosen one, and no two chosen ones are near, which is
    not so for every k-th point of a lattice.
    """
    X = np.stack(np.meshgrid(*3 * [np.arange(12.0)]), -1).reshape(-1, 3)
    shown, rows = even_subset(X, 200), np.arange(0, len(X), 9)
    assert len(np.unique(shown)) == 200
    evenness = []
    for chosen in (shown, rows):
        gap = cKDTree(X[chosen]).query(X)[0].max()
        nearest = cKDTree(X[chosen]).query(X[chosen], 2)[0][:, 1].min()
        evenness.append(gap / nearest)
    assert evenness[0] <= 1.0 < evenness[1]
    assert even_subset(X, len(X)).tolist() == list(range(len(X)))
