"""L-BFGS whose first inverse Hessian is that of the start of the step (HOT-alg3).

Multigrid gives HOT, CG gives LBFGS-H. A pair (s, y) enters the window only if y . s > 0, which
keeps the inverse positive definite; on convex stretches that is always so.
"""

from collections import deque
from typing import NamedTuple

import numpy as np

from .norms import dot, length


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
    """Directions for `descent` from the last `window` pairs and the inverse that build(dv) gives.

    It is built at the first iterate and, if `rebuild` is not 0, after every so many steps; then
    the pairs, which belong to the old one, are forgotten.
    """

    def __init__(self, build, window, rebuild):
        self.build, self.rebuild = build, rebuild
        self.pairs = deque(maxlen=window)
        self.inverse, self.age = None, 0

    def direction(self, dv, g):
        """p (n, d) [m/s]; the first is inverse(-g)."""
        if self.inverse is None:
            self.inverse = self.build(dv)
        return two_loop(-g, self.pairs, self.inverse)

    def learn(self, s, y):
        """Take the pair of an accepted step into the window."""
        self.age += 1
        curvature = dot(y, s)
        if curvature > np.finfo(float).eps * length(y) * length(s):
            self.pairs.append(Pair(s, y, 1.0 / curvature))
        if self.rebuild and self.age % self.rebuild == 0:
            self.refresh()

    def refresh(self):
        """Forget everything, so that the next direction builds its inverse anew; False if nothing
        was learnt since the last time.
        """
        learnt = self.age > 0
        self.pairs.clear()
        self.inverse, self.age = (None, 0) if learnt else (self.inverse, 0)
        return learnt
