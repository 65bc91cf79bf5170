"""The measure of agreement between the package and a second implementation, and its records."""

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


def record_checks(run, group, checks):
    """Record the difference of each part of {part: (function that returns it, bound, scale, note)}
    under the id of a group. A difference is made of rounding errors, which another processor rounds
    otherwise: its scatter is 1, and its bound alone judges.
    """
    for part, (agreement, bound, scale, note) in checks.items():
        run.record(f"{group}.{part}", agreement(), comparator="<=", bound=bound, unit="1",
                   scale=scale, note=note, scatter=1.0)
