"""A reference solution with an error estimate, from runs on grids halved again and again.

Time step and particles follow the grid. Until each time t, E is the largest difference of two
successive grids so far, and p = log2(E_coarse/E_fine) the observed order of the last three grids.
The reference is the Richardson extrapolation q + (q - q_coarser)/(2^p - 1), and its error the grid
convergence index F E/(2^p - 1) [Roache1994]: with F = 1.25 and p at most 2 if the orders of the
last four grids agree (of three grids: if it is at most 3, since a larger one may be an accident),
else with F = 3 and p at most 1, without extrapolation. Where p is below 0.5 the runs show no
convergence: the reference is that on the finest grid, and its error three times the larger of the
two last differences [EcaHoekstra2014]. Errors are relative to the largest change of the quantity
until t.
"""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from ..sweep.difference import change_so_far, difference_so_far, relative_difference

SAFE, CAUTIOUS = 1.25, 3.0      # factors of differences of grids
LEAST, MOST = 0.5, 2.0          # orders that are believed
AGREEMENT = 1.0                 # of two successive orders
NOTHING = 1e-12                 # of the change: a difference that is round-off


@dataclass(frozen=True)
class QuantityReference:
    """The reference of one quantity. Index k of an error stands for the run until time k."""

    values: np.ndarray      # (T, k) extrapolated
    scale: np.ndarray       # (T,) largest change so far
    error: np.ndarray       # (T,) estimate, relative; infinite where nothing is known
    order: np.ndarray       # (T,) observed
    extrapolated: np.ndarray    # (T,) whether the values are; else they are the finest grid's
    differences: tuple      # between successive grids over the whole run, relative

    def raised(self, error):
        """Return this reference with at least another estimate (T,) of its error."""
        return replace(self, error=np.maximum(self.error, error))

    def error_of(self, values, at_end=False):
        """Return the largest difference so far (T,) of a run's values (T, k), relative to the
        largest change so far; at_end: the difference at each time alone.
        """
        if at_end:
            difference = relative_difference(values, self.values, 1.0)
        else:
            difference = difference_so_far(values, self.values)
        return relative(np.where(np.isnan(difference), np.inf, difference), self.scale)


def reference_of(levels):
    """Return the `QuantityReference` of values (T, k) on grids from coarse to fine, at least two.

    With two grids there is no observed order: the error is infinite.
    """
    scale = change_so_far(levels[-1])
    pairs = [difference_so_far(coarse, fine) for coarse, fine in pairwise(levels)]
    order, safe = observed_order(pairs, scale)
    p = np.clip(order, LEAST, np.where(safe, MOST, 1.0))
    factor = np.where(safe, 1.0 / (2.0**p - 1.0), 0.0)
    values = levels[-1] + factor[:, None] * (levels[-1] - levels[-2])
    error = np.where(safe, SAFE, CAUTIOUS) / (2.0**p - 1.0) * relative(pairs[-1], scale)
    spread = np.max(pairs[-2:], axis=0) if len(pairs) > 1 else np.full(len(scale), np.inf)
    error = np.where(order < LEAST, CAUTIOUS * relative(spread, scale), error)
    error = np.where(pairs[-1] <= NOTHING * scale, NOTHING, error)
    error[0] = np.inf       # where nothing has changed yet
    last = tuple(float(relative(pair, scale)[-1]) for pair in pairs)
    return QuantityReference(values, scale, error, order, safe, last)


def observed_order(pairs, scale):
    """Return the observed order (T,) of differences (T,) between successive grids, and whether it
    agrees with that of the grids before (T,), as it does where there are none.

    The order is 0 with less than two differences.
    """
    if len(pairs) < 2:
        return np.zeros(len(scale)), np.zeros(len(scale), dtype=bool)
    orders = [log_ratio(coarse, fine, scale) for coarse, fine in pairwise(pairs)]
    last = orders[-1]
    if len(orders) < 2:
        return last, (last >= LEAST) & (last <= MOST + AGREEMENT)
    agree = np.abs(last - orders[-2]) <= AGREEMENT
    return last, agree & (np.minimum(last, orders[-2]) >= LEAST)


def log_ratio(coarse, fine, scale):
    """Return log2(coarse/fine) (T,), both at least round-off; 0 where it is not a number."""
    floor = NOTHING * np.where(scale > 0.0, scale, 1.0)
    with np.errstate(invalid="ignore"):
        order = np.log2(np.maximum(coarse, floor) / np.maximum(fine, floor))
    return np.where(np.isfinite(order), order, 0.0)


def relative(difference, scale):
    """Return a difference (T,) over the change so far (T,); infinite where nothing has changed."""
    return np.divide(difference, scale, out=np.full(len(scale), np.inf), where=scale > 0.0)


def reliable_times(references, error):
    """Return the mask (T,) of times until which all references are known to an error."""
    return np.logical_and.reduce([reference.error <= error for reference in references])
