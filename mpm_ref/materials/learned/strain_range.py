"""Bounds of the strains in a law's training: of each stretch s_0 >= s_1 >= .. and of J.

Outside of the bounds there were no training data; inside there may be gaps. A point is out of
bounds by

    excess_p = max over a of  max(low_a - a_p, a_p - high_a, 0) / (high_a - low_a)

with a over the stretches and J = det F: the distance to the bounds in units of their width.
"""

import numpy as np

from .invariants import spectrum

ROUND_OFF = 1e-9        # of stretches and J: so far out counts as within bounds
MIN_WIDTH = 1e-9        # of bounds without width, of laws trained at rest alone


def strain_measures(F):
    """Return the stretches in descending order, then J, (n, d + 1), of F (n, d, d)."""
    s = spectrum(np.ascontiguousarray(F)).s
    return np.column_stack([s, s.prod(axis=1)])


def strain_bounds(F):
    """Return the bounds of deformation gradients F (.., d, d), {"low", "high"} of plain values."""
    measures = strain_measures(F.reshape(-1, *F.shape[-2:]))
    return {"low": measures.min(axis=0).tolist(), "high": measures.max(axis=0).tolist()}


def within_bounds(F, bounds):
    """Return whether each of F (n, d, d) is finite and lies within bounds, as (n,)."""
    measures, slack = strain_measures(F), ROUND_OFF
    low, high = (np.array(bounds[end]) for end in ("low", "high"))
    return np.all((measures >= low - slack) & (measures <= high + slack), axis=1)


def excess(measures, bounds):
    """Return the excess (n,) of points with strain measures (n, d + 1) over the bounds.

    It is infinite for J <= 0 below the bounds, and where F is not finite.
    """
    low, high = (np.array(bounds[end]) for end in ("low", "high"))
    with np.errstate(invalid="ignore", over="ignore"):
        out = np.maximum(low - measures, measures - high) / np.maximum(high - low, MIN_WIDTH)
        worst = np.maximum(out.max(axis=1), 0.0)
        inverted = (measures[:, -1] <= 0.0) & (measures[:, -1] < low[-1])
    return np.where(inverted | ~np.isfinite(measures).all(axis=1), np.inf, worst)


def farthest(F, bounds):
    """Return the point of F (n, d, d) that is farthest out of bounds, its strain measures and its
    excess; of points that are not finite only where all are.
    """
    with np.errstate(invalid="ignore", over="ignore"):
        measures = strain_measures(F)
    out = excess(measures, bounds)
    finite = np.isfinite(measures).all(axis=1)
    p = int(np.argmax(np.where(finite | ~finite.any(), out, -1.0)))
    return p, measures[p], float(out[p])


def describe_strains(measures):
    """Return stretches and J in words."""
    *s, J = (f"{a:.4g}" for a in measures)
    return f"principal stretches {', '.join(s)}, J = {J}"


def describe_bounds(bounds):
    """Return the ranges of stretches and of J in words."""
    *ranges, of_J = (f"{low:.4g} to {high:.4g}"
                     for low, high in zip(bounds["low"], bounds["high"], strict=True))
    return f"{', '.join(ranges)}, J {of_J}"


def stored_bounds(about, d):
    """Return the bounds that the record of a training holds, and its `dt` [s] or None; with the
    laws' error on their own run, `run_error`, where the record has it; or None.

    Raises ValueError for bounds that are not those of d dimensions.
    """
    if "seen" not in about:
        return None
    given = about["seen"]
    try:
        low, high = (np.array(given[end], dtype=float) for end in ("low", "high"))
    except (TypeError, KeyError, ValueError):
        low = high = np.zeros(0)
    if low.shape != (d + 1,) or high.shape != (d + 1,) or not (low <= high).all():
        raise ValueError(f"strains seen in training: {given}; expected low and high, for {d} "
                         "stretches and J; train again")
    dt = about.get("dt")
    if dt is not None and not (isinstance(dt, int | float) and 0.0 < dt < np.inf):
        raise ValueError(f"time step of training: {dt}; expected a number above 0, in s; train "
                         "again")
    own = {name: about[name] for name in ("run_error",) if name in about}
    return {"low": low.tolist(), "high": high.tolist(), "dt": dt, **own}
