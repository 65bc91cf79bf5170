"""A reference solution with an error estimate, from runs on grids halved again and again.

Time step and particles follow the grid. Of three grids with differences E_1 (coarser pair) and E_2
(finer pair), each the largest so far in the run, p = log2(E_1/E_2) is the observed order; the
reference is the Richardson extrapolation q + (q - q_coarser)/(2^p - 1), and its error the grid
convergence index 1.25 E_2/(2^p - 1) [Roache1994]. p is bounded above by 2; with p below 0.5 the
runs do not converge, and nothing is claimed.
"""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from ..sweep.difference import largest_change, relative_difference, running_maximum

SAFETY = 1.25           # of the grid convergence index for three grids
LEAST, MOST = 0.5, 2.0  # orders that are believed
NOTHING = 1e-12         # a difference that is round-off


@dataclass(frozen=True)
class QuantityReference:
    """The reference of one quantity."""

    values: np.ndarray      # (T, k) extrapolated
    scale: float            # the change that errors are relative to
    error: np.ndarray       # (T,) estimate, relative, never falling; infinite where not known
    order: np.ndarray       # (T,) observed
    differences: tuple      # of the last value of the error between successive grids

    def raised(self, error):
        """Return this reference with at least another estimate (T,) of its error."""
        return replace(self, error=running_maximum(np.maximum(self.error, error)))

    def error_of(self, values):
        """Return the largest relative difference so far (T,) of a run's values (T, k)."""
        return running_maximum(relative_difference(values, self.values, self.scale))


def reference_of(levels):
    """Return the `QuantityReference` of values (T, k) on grids from coarse to fine, at least two.

    With two grids there is no observed order: the error is infinite.
    """
    scale = largest_change(levels[-1])
    pairs = [running_maximum(relative_difference(coarse, fine, scale))
             for coarse, fine in pairwise(levels)]
    order = observed_order(pairs)
    believed = np.clip(order, LEAST, MOST)
    with np.errstate(invalid="ignore"):
        factor = 1.0 / (2.0**believed - 1.0)
        values = levels[-1] + factor[:, None] * (levels[-1] - levels[-2])
        error = SAFETY * factor * pairs[-1]
    error = np.where(order < LEAST, np.inf, error)
    error = np.where(pairs[-1] <= NOTHING, NOTHING, error)
    last = tuple(float(pair[-1]) for pair in pairs)
    return QuantityReference(values, scale, running_maximum(error), order, last)


def observed_order(pairs):
    """Return log2 of the ratio of the two last differences (T,); 0 with less than two."""
    if len(pairs) < 2:
        return np.zeros(len(pairs[-1]))
    coarse, fine = np.maximum(pairs[-2], NOTHING), np.maximum(pairs[-1], NOTHING)
    with np.errstate(invalid="ignore"):
        order = np.log2(coarse / fine)
    return np.where(np.isfinite(order), order, 0.0)


def reference_horizon(reference, times, error):
    """Return the last time [s] up to which a reference's own error is at most an error; 0 where it
    never is after the start.
    """
    good = reference.error <= error
    return float(times[int(np.argmin(good)) - 1] if not good.all() else times[-1])
