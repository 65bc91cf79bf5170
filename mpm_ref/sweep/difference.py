"""Differences of two runs, relative to the largest change of a quantity during the reference."""

import numpy as np


def largest_change(values):
    """Return the largest root mean square of values (T, k) minus those at the start.

    It is that of the values themselves where nothing changes, and 1 where they are zero.
    """
    change = float(np.nanmax(rms(values - values[0]), initial=0.0))
    size = float(np.nanmax(rms(values), initial=0.0))
    if change > 1e-9 * size:
        return change
    return size if size > 0.0 else 1.0


def rms(values):
    """Return the root mean square (T,) over the numbers of each time."""
    return np.sqrt(np.mean(np.square(values), axis=1)) if values.shape[1] else np.full(
        len(values), np.nan)


def relative_difference(values, reference, scale):
    """Return the root mean square difference (T,) of two runs' values (T, k) over a scale; NaN
    after one of them stopped, or where their numbers differ.
    """
    if values.shape != reference.shape:
        return np.full(len(reference), np.nan)
    return rms(values - reference) / scale


def running_maximum(error):
    """Return the largest of an error (T,) up to each time; infinite from a NaN on."""
    return np.maximum.accumulate(np.where(np.isnan(error), np.inf, error))
