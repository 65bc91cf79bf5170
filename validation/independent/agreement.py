"""The measure of agreement between the package and a second implementation."""

import numpy as np


def difference(a, b, change=None):
    """Return the largest |a - b| over the largest |change|, b if None; infinite for arrays of
    other shapes, and where a number is not finite.
    """
    a, b = np.asarray(a), np.asarray(b)
    if a.shape != b.shape:
        return np.inf
    share = np.abs(a - b).max() / np.abs(b if change is None else change).max()
    return float(share) if np.isfinite(share) else np.inf
