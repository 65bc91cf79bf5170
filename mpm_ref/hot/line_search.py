"""Backtracking from the full step: the energy must fall, as far as it can be told from round-off.

The authors accept any decrease (HOT-alg1, HOT-alg3). Near the minimum the difference of two
energies is round-off, and such a test refuses good steps or accepts bad ones. There, the change is
taken from the slopes at both ends instead [HagerZhang2005]: their mean times the step is exact for
a quadratic, and small numbers are not formed as differences of large ones.

    E' - E = alpha (g + g') . p / 2 + O(alpha^3)
"""

from math import isfinite
from typing import NamedTuple

import numpy as np

from .norms import dot


class Iterate(NamedTuple):
    """An iterate with its energy and gradient."""

    dv: np.ndarray      # (n, d) [m/s]
    E: float            # [J]
    g: np.ndarray       # (n, d) [kg m/s]


class LineSearchOptions(NamedTuple):
    """Bounds of a search."""

    shrink: float = 0.5     # factor between trials
    floor: float = 1e-10    # smallest share of the full step that is tried
    cap: int = 40           # trials refused before the search gives up
    noise: float = 1e-10    # share of |E| below which a difference is round-off


class LineSearchResult(NamedTuple):
    """The accepted `Iterate`, or None and `message`; and how many trials were refused."""

    point: Iterate | None
    message: str | None
    backtracks: int


def search(system, now, p, rules):
    """`LineSearchResult` along p (n, d) [m/s] from the `Iterate` now."""
    slope = dot(now.g, p)
    if not isfinite(slope):
        return LineSearchResult(None, f"the direction is not finite: g . p = {slope:.3g}", 0)
    if not slope < 0.0:
        message = f"not a descent direction: g . p = {slope:.3g}, expected < 0"
        return LineSearchResult(None, message, 0)
    alpha, refused, noise = 1.0, 0, rules.noise * abs(now.E)
    while alpha >= rules.floor and refused <= rules.cap:
        trial = trial_iterate(system, now.dv + alpha * p, now.E + noise, fused=refused == 0)
        if trial is not None and decreases(now, trial, p, slope, noise):
            return LineSearchResult(trial, None, refused)
        alpha, refused = alpha * rules.shrink, refused + 1
    limit = "floor" if alpha < rules.floor else "cap"
    return LineSearchResult(None, f"the line search refused {refused} steps, down to its {limit}, "
                            f"along a slope of {slope:.3g} J", refused)


def trial_iterate(system, dv, limit, fused):
    """The `Iterate` at dv, or None if its energy exceeds the limit.

    The full step is nearly always accepted, so energy and gradient come from one pass there;
    shorter ones ask for the energy first.
    """
    if not fused and not system.energy(dv) <= limit:
        return None
    return Iterate(dv, *system.evaluate(dv))


def decreases(now, trial, p, slope, noise):
    """Return whether the energy falls from now to trial, by the slopes where round-off hides it.

    A trial that is not finite does not lower it.
    """
    if not np.isfinite(trial.g).all():
        return False
    if abs(trial.E - now.E) <= noise:
        return slope + dot(trial.g, p) <= 0.0
    return trial.E < now.E
