"""Conversion of symmetric tensors to their independent values, the upper triangle row by row."""

import numpy as np


def values(a):
    """Return the values (.., d (d + 1) / 2) of symmetric tensors a (.., d, d): 11, 12, 22, or 11,
    12, 13, 22, 23, 33.
    """
    return a[(..., *np.triu_indices(a.shape[-1]))]


def tensor(a, d):
    """Return the symmetric tensors (.., d, d) of values a (.., d (d + 1) / 2)."""
    rows, columns = np.triu_indices(d)
    place = np.empty((d, d), dtype=int)
    place[rows, columns] = place[columns, rows] = np.arange(len(rows))
    return a.take(place, axis=-1).astype(float, copy=False)
