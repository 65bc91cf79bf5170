"""Errors and their order."""

from math import isfinite, log, nan

import numpy as np


def rms(error):
    """Root of the mean square length of N vectors (N, d)."""
    return float(np.sqrt(np.mean(np.sum(np.square(error), axis=-1))))


def order(sizes, errors):
    """Slope of log(error) against log(size), by least squares; NaN unless all are > 0, finite."""
    if not all(isfinite(e) and e > 0.0 for e in errors):
        return nan
    x, y = [log(h) for h in sizes], [log(e) for e in errors]
    return float(np.polyfit(x, y, 1)[0])


def extrapolated(sizes, values, order):
    """Limit at size 0 of values with an error proportional to size^order, from the last two."""
    (h, H), (fine, coarse) = (sizes[-1], sizes[-2]), (values[-1], values[-2])
    return fine + (fine - coarse) / ((H / h) ** order - 1.0)
