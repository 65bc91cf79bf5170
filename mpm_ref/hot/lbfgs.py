"""L-BFGS whose first inverse Hessian is that of the start of the step (HOT-alg3).

Multigrid gives HOT, CG gives LBFGS-H. A pair (s, y) enters the window only if y . s > 0, which
keeps the inverse positive definite; on convex stretches that is always so.
"""

from collections import deque
from typing import NamedTuple

import numpy as np

from .norms import dot, length

RENEWALS = ("never", "shortened", "stale")
STALE = 0.75        # of the curvature, or the inverse of that: a Hessian is taken anew
PAYS = 8            # steps that a new Hessian costs about as much as, with its multigrid


class Pair(NamedTuple):
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
    `linearization.Linear` which build(dv) gives.

    It is built at the first iterate, and as it is dear (HOT-cost), no more in general. It is built
    anew after every `rebuild` steps if that is not 0, and, as `renew` says, where it has been seen
    to be wrong (see `seen_wrong`). Then the pairs, which belong to the old one, are forgotten.
    """

    def __init__(self, build, window, rebuild=0, renew="never"):
        self.build, self.rebuild, self.renew = build, rebuild, renew
        self.pairs = deque(maxlen=window)
        self.linear, self.age = None, 0

    def direction(self, dv, g):
        """p (n, d) [m/s]; the first is inverse(-g)."""
        return two_loop(-g, self.pairs, self.first(dv))

    def first(self, dv):
        """The first inverse, built at dv if there is none."""
        if self.linear is None:
            self.linear = self.build(dv)
        return self.linear.inverse

    def learn(self, s, y, full=True):
        """Take the pair of an accepted step into the window; `full` if none of it was cut."""
        self.age += 1
        curvature = dot(y, s)
        if curvature > np.finfo(float).eps * length(y) * length(s):
            self.pairs.append(Pair(s, y, 1.0 / curvature))
        spent = self.rebuild and self.age % self.rebuild == 0
        if spent or (self.renew != "never" and self.seen_wrong(s, curvature, full)):
            self.refresh()

    def seen_wrong(self, s, curvature, full):
        """Whether a step shows that the first inverse is far from that of the Hessian.

        "shortened": a line search cut it. "stale": it did, and not the first step of a new Hessian,
        or the curvature y . s along a later step is not near that of the Hessian H which was
        inverted, s . H s.
        """
        if self.renew == "shortened":
            return not full
        if not full or self.age < PAYS:
            return not full and self.age > 1
        then = dot(s, self.linear.product(s))
        return not STALE * then < curvature < then / STALE

    def refresh(self):
        """Forget everything, so that the next direction builds its inverse anew; False if nothing
        was learnt since the last time.
        """
        learnt = self.age > 0
        self.pairs.clear()
        self.linear, self.age = (None, 0) if learnt else (self.linear, 0)
        return learnt
