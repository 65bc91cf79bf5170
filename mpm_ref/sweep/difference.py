"""Differences of two runs, and the change of a quantity that they are relative to."""

import numpy as np

STILL = 1e-9        # of the size of a quantity: a change that is none


def largest_change(values):
    """Return the largest root mean square change of values (T, k) since the start.

    Where the values never change it is their own size, and 1 where they are zero.
    """
    return float(change_so_far(values)[-1])


def change_so_far(values):
    """Return the largest root mean square change (T,) of values (T, k) since the start, until each
    time; constant, as `largest_change` says, where they never change.
    """
    size = float(np.nanmax(rms(values), initial=0.0))
    change = np.fmax.accumulate(rms(values - values[0]))
    if not change[-1] > STILL * size:
        return np.full(len(values), size if size > 0.0 else 1.0)
    return change


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


def difference_so_far(values, reference):
    """Return the largest root mean square difference (T,) of two runs' values until each time."""
    return running_maximum(relative_difference(values, reference, 1.0))


def rms(values):
    """Return the root mean square (T,) over the numbers of each time; NaN without numbers."""
    if not values.shape[1]:
        return np.full(len(values), np.nan)
    return np.sqrt(np.mean(np.square(values), axis=1))
