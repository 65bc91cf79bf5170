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

from .line_search import Iterate, search
from .norms import length, scaled_norm

ROUND_OFF = 1e-13       # of the energy; many slow steps may lower it by less than a search can tell


class StoppingRule(NamedTuple):
    """Conditions under which the loop ends."""

    eps: float          # tolerance of the gradient's size
    norm: str           # "characteristic": ||g^||_2 / sqrt(n); "L2": ||g||_2 [kg m/s]
    max_iterations: int
    patience: int       # steps that lower neither the gradient nor, beyond round-off, the energy


class BestIterate:
    """The best iterate so far, and for how many iterates nothing has improved."""

    def __init__(self, noise):
        self.noise = noise
        self.best, self.least, self.lowest, self.idle = None, inf, inf, 0

    def update(self, point, size):
        """Compare an iterate, whose gradient has the given size, with those before."""
        fallen = point.E < self.lowest - self.noise * abs(point.E)
        if self.best is None or size < self.least:
            self.best, self.least, fallen = point, size, True
        self.lowest = point.E if fallen else self.lowest
        self.idle = 0 if fallen else self.idle + 1


def descend(system, method, stop, rules, profiler):
    """Minimise from system.start; return (`Iterate`, None), or (best `Iterate`, message).

    The method has direction(dv, g) -> p; update(s, y, full), called after an accepted step, which
    may be the full one; restart() -> whether it has a better direction after one was refused.
    `rules` bound the line search, `profiler` counts.
    """
    advance = line_search_steps(system, method, rules, profiler)
    return iterate(system, system.start, advance, stop, profiler)


def line_search_steps(system, method, rules, profiler):
    """Return the function advance(`Iterate`) of a method, for `iterate`."""
    return lambda now: next_iterate(system, method, now, rules, profiler)


def iterate(system, start, advance, stop, profiler):
    """Minimise as `descend`, from start (n, d), by steps advance(`Iterate`) -> (`Iterate`, None) or
    (None, message).
    """
    now = Iterate(start.copy(), *system.evaluate(start))
    best = BestIterate(ROUND_OFF)
    for k in range(stop.max_iterations + 1):
        profiler.record(scaled_norm(now.g, system.kappa))
        size = gradient_size(now, system.kappa, stop.norm)
        best.update(now, size)
        if np.isfinite(now.E) and size <= stop.eps:
            return now, None
        message = failure_message(now, size, k, best.idle, stop)
        if message is not None:
            return best.best, message
        now, message = advance(now)
        if message is not None:
            return best.best, message


def gradient_size(point, kappa, norm):
    """Return the size of an iterate's gradient in a norm of `StoppingRule`."""
    return scaled_norm(point.g, kappa) if norm == "characteristic" else length(point.g)


def failure_message(now, size, k, idle, stop):
    """Return why the loop cannot go on at an iterate that has not converged, or None."""
    if not (np.isfinite(now.E) and np.isfinite(size)):
        return f"energy {now.E:.3g} J, gradient {size:.3g} at iterate {k}: expected finite values"
    if k == stop.max_iterations:
        return f"{k} iterations, the cap, left the gradient at {size:.3g} > {stop.eps:.3g}"
    if idle >= stop.patience:
        return (f"neither energy nor gradient fell in {idle} iterations: the gradient stays at "
                f"{size:.3g} > {stop.eps:.3g}, near the limit of round-off or in a cycle")
    return None


def next_iterate(system, method, now, rules, profiler):
    """Return (next `Iterate`, None) or (None, message)."""
    while True:
        p = system.project(method.direction(now.dv, now.g))
        found = search(system, now, p, rules)
        profiler.backtracks += found.backtracks
        if found.point is not None:
            full = found.backtracks == 0
            method.update(found.point.dv - now.dv, found.point.g - now.g, full)
        if found.point is not None or not method.restart():
            return found.point, found.message
        profiler.restarts += 1
