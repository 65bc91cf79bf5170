"""L-BFGS whose first inverse Hessian is that of the start of the step (HOT-alg3).

Multigrid gives HOT, CG gives LBFGS-H. A pair (s, y) enters the window only if y . s > 0, which
keeps the inverse positive definite; on convex stretches that is always so.
"""

from collections import deque
from typing import NamedTuple

import numpy as np

from .norms import dot, length

REBUILD_RULES = ("never", "shortened", "stale")
STALE = 0.75        # of the curvature, or the inverse of that: a Hessian is rebuilt
REBUILD_COST = 8    # steps that a new Hessian costs about as much as, with its multigrid


class CurvaturePair(NamedTuple):
    """A step and the change of the gradient along it."""

    s: np.ndarray       # (n, d) [m/s]
    y: np.ndarray       # (n, d) [kg m/s]
    rho: float          # 1 / (y . s) [1/J]


def two_loop(q, pairs, inverse):
    """Quasi-Newton inverse times q; newest pair last, `inverse` is the first one (HOT-alg3;
    [NocedalWright2006] alg. 7.4).
    """
    q, alphas = q.copy(), []
    for s, y, rho in reversed(pairs):
        alphas.append(rho * dot(s, q))
        q -= alphas[-1] * y
    r = inverse(q)
    for (s, y, rho), alpha in zip(pairs, reversed(alphas)):
        r = r + (alpha - rho * dot(y, r)) * s
    return r


class LBFGS:
    """Directions for `descent` from the last `window` pairs and the first inverse, that of the
    `Linearization` that build(dv) returns.

    It is built at the first iterate and, as it is expensive (HOT-cost), in general no more. It is
    rebuilt after every `rebuild_every` steps if that is not 0 and, as `rebuild_when` says, where a
    step shows it to be wrong (see `is_stale`). The pairs, which belong to the old one, are then
    dropped.
    """

    def __init__(self, build, window, rebuild_every=0, rebuild_when="never"):
        self.build, self.rebuild_every, self.rebuild_when = build, rebuild_every, rebuild_when
        self.pairs = deque(maxlen=window)
        self.linear, self.age = None, 0

    def direction(self, dv, g):
        """p (n, d) [m/s]; the first is inverse(-g)."""
        return two_loop(-g, self.pairs, self.initial_inverse(dv))

    def initial_inverse(self, dv):
        """The first inverse, built at dv if there is none."""
        if self.linear is None:
            self.linear = self.build(dv)
        return self.linear.inverse

    def update(self, s, y, full=True):
        """Take the pair of an accepted step into the window; `full` if none of it was cut."""
        self.age += 1
        curvature = dot(y, s)
        if curvature > np.finfo(float).eps * length(y) * length(s):
            self.pairs.append(CurvaturePair(s, y, 1.0 / curvature))
        due = self.rebuild_every and self.age % self.rebuild_every == 0
        if due or (self.rebuild_when != "never" and self.is_stale(s, curvature, full)):
            self.restart()

    def is_stale(self, s, curvature, full):
        """Return whether a step shows that the first inverse is far from that of the Hessian.

        "shortened": a line search cut it. "stale": it did, and not the first step of a new Hessian,
        or the curvature y . s along a later step is not near that of the Hessian H which was
        inverted, s . H s.
        """
        if self.rebuild_when == "shortened":
            return not full
        if not full or self.age < REBUILD_COST:
            return not full and self.age > 1
        old = dot(s, self.linear.product(s))
        return not STALE * old < curvature < old / STALE

    def restart(self):
        """Drop all pairs and the inverse, which the next direction builds anew; return False if
        there was no step since the last restart.
        """
        stepped = self.age > 0
        self.pairs.clear()
        self.linear, self.age = (None, 0) if stepped else (self.linear, 0)
        return stepped
