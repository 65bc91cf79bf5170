"""ADMM, the comparator of HOT's Figure 16 (HOT-methods; [RPIC], Fang et al. 2019).

    Z_p, multipliers:  local, see `splitting`         K (dv' - dv) = -(gradient of the Lagrangian)

HOT prints no formulas. This is the plain splitting of its potential; what we assume: constant
penalties that follow the stiffness at rest, multipliers zero at first, no relaxation, one local
and one global step per iteration, the latter by CG with Jacobi's preconditioner to a share of its
right-hand side. Only elasticity is split: the return map stays lagged, as in all methods here.
A first-order method: it converges linearly, and energies may rise on the way; there is no line
search. For potentials that are not convex a penalty that is too small may end in a cycle, which the
report says. The residual is that of the potential itself (HOT-eq9), so that all methods stop alike.
"""

from .krylov import Rule
from .line_search import Point
from .linear import Linear, solve

SHARE = 0.1     # of its right-hand side, in the energy norm, to which a global step is solved


class ADMM:
    """Iterates of ADMM on a `System`, from the increment dv (n, d) where it stands.

    `penalty` is that of `splitting.Splitting`, `cap` bounds CG; `watch` counts.
    """

    def __init__(self, system, penalty, cap, watch):
        self.system, self.penalty, self.watch = system, penalty, watch
        self.rule = Rule(lambda size: SHARE, cap)
        self.splitting = None

    def advance(self, now):
        """(`Point`, None): the next iterate, whatever its energy."""
        if self.splitting is None:
            self._begin(now.dv)
        with self.watch.part("local"):
            g, missed = self.splitting.local_step(now.dv)
        self.watch.capped += missed > 0
        dv = now.dv + solve(self.linear, -self.system.free(g), self.rule, self.watch)
        return Point(dv, *self.system.evaluate(dv)), None

    def _begin(self, dv):
        self.splitting = self.system.splitting(dv, self.penalty)
        with self.watch.part("assembly"):
            K = self.splitting.matrix()
        self.watch.builds += 1
        self.linear = by_component(K, self.system.free)


def by_component(K, free):
    """`Linear` of B (K x I) for a matrix K (n, n) and the projection `free`, on u = B u."""
    inverse = (1.0 / K.diagonal())[:, None]
    return Linear(lambda u: free(K @ u), lambda r: free(inverse * r))
