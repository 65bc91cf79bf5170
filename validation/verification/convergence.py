"""Errors and their order."""

import numpy as np


def rms(error):
    """Root of the mean square length of N vectors (N, d)."""
    return float(np.sqrt(np.mean(np.sum(np.square(error), axis=-1))))


def order(sizes, errors):
    """Slope of log(error) against log(size), by least squares; NaN if an error is not finite."""
    if not np.all(np.isfinite(errors)):
        return float("nan")
    return float(np.polyfit(np.log(sizes), np.log(errors), 1)[0])
