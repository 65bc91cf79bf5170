"""The loop that Newton (HOT-alg1) and L-BFGS (HOT-alg3) share; they differ in the direction.

    while ||g^||_2 > eps sqrt(n):    p <- direction(dv, g)
                                     alpha <- line search
                                     dv <- dv + alpha p

It ends converged or with the reason why not, and returns the accepted iterate of the smallest
gradient. That iterate is final: the public release adds the last step to it once more.
"""

from math import inf
from typing import NamedTuple

import numpy as np

from .line_search import Point, search
from .norms import length, scaled_norm

ROUND_OFF = 1e-13       # of the energy; many slow steps may lower it by less than a search can tell


class Stop(NamedTuple):
    """When to end the loop."""

    eps: float          # tolerance of the gradient's size
    norm: str           # "characteristic": ||g^||_2 / sqrt(n); "L2": ||g||_2 [kg m/s]
    iterations: int     # at most
    patience: int       # steps that lower neither the gradient nor, beyond round-off, the energy


class Progress:
    """The best iterate so far, and for how many iterates nothing has improved."""

    def __init__(self, noise):
        self.noise = noise
        self.best, self.least, self.lowest, self.idle = None, inf, inf, 0

    def note(self, point, size):
        """Count in an iterate whose gradient has the given size."""
        fallen = point.E < self.lowest - self.noise * abs(point.E)
        if self.best is None or size < self.least:
            self.best, self.least, fallen = point, size, True
        self.lowest = point.E if fallen else self.lowest
        self.idle = 0 if fallen else self.idle + 1


def descend(system, method, stop, rules, watch):
    """(`Point`, why not converged or None) from system.start, for a method with

    direction(dv, g) -> p; learn(s, y, full) from an accepted step, which may be the full one;
    refresh() -> whether it can do better after a direction was refused. `rules` bound the line
    search, `watch` counts.
    """
    return iterate(system, system.start, advance_of(system, method, rules, watch), stop, watch)


def advance_of(system, method, rules, watch):
    """The steps of a method, for `iterate`."""
    return lambda now: advanced(system, method, now, rules, watch)


def iterate(system, start, advance, stop, watch):
    """As `descend`, from start (n, d) by steps advance(`Point`) -> (`Point`, None), or (None, why
    there is none).
    """
    now = Point(start.copy(), *system.evaluate(start))
    progress = Progress(ROUND_OFF)
    for k in range(stop.iterations + 1):
        watch.note(scaled_norm(now.g, system.kappa))
        size = watch.residuals[-1] if stop.norm == "characteristic" else length(now.g)
        progress.note(now, size)
        if np.isfinite(now.E) and size <= stop.eps:
            return now, None
        why = spent(now, size, k, progress.idle, stop)
        if why is not None:
            return progress.best, why
        now, why = advance(now)
        if why is not None:
            return progress.best, why


def spent(now, size, k, idle, stop):
    """Why the loop cannot go on at an iterate that has not converged, or None."""
    if not (np.isfinite(now.E) and np.isfinite(size)):
        return f"energy {now.E:.3g} J, gradient {size:.3g} at iterate {k}: expected finite values"
    if k == stop.iterations:
        return f"{k} iterations, the cap, left the gradient at {size:.3g} > {stop.eps:.3g}"
    if idle >= stop.patience:
        return (f"neither energy nor gradient fell in {idle} iterations: the gradient stays at "
                f"{size:.3g} > {stop.eps:.3g}, near the limit of round-off or in a cycle")
    return None


def advanced(system, method, now, rules, watch):
    """The next `Point`, or None and why there is none."""
    while True:
        p = system.free(method.direction(now.dv, now.g))
        found = search(system, now, p, rules)
        watch.backtracks += found.backtracks
        if found.point is not None:
            full = found.backtracks == 0
            method.learn(found.point.dv - now.dv, found.point.g - now.g, full)
        if found.point is not None or not method.refresh():
            return found.point, found.why
        watch.refreshes += 1
