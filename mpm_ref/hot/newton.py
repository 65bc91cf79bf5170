"""Inexact projected Newton: each direction by CG on the Hessian of the iterate (HOT-alg1)."""

from .krylov import CGOptions, newton_tolerance
from .linearization import solve
from .norms import length


class Forcing:
    """Tolerance k of the linear solves (HOT-sec5.3-k).

    norm "energy": from sqrt(g.P g), P the preconditioner, as HOT's baselines; "L2": from ||g||_2,
    as [Gast2015]. tau [kg m/s] is the tolerance of the outer loop, as an L2 norm.
    """

    def __init__(self, norm, tau):
        self.norm, self.tau = norm, tau

    def relative_tolerance(self, g):
        """Return the function from sqrt(g.P g) to k."""
        def relative(size):
            return newton_tolerance(size if self.norm == "energy" else length(g), self.tau)
        return relative


class Newton:
    """Directions p of H p = -g for `descent`, H and its preconditioner being linearise(dv).

    `cap` and `flexible` are those of `krylov.CGOptions`.
    """

    def __init__(self, linearise, forcing, cap, flexible, profiler):
        self.linearise, self.forcing, self.profiler = linearise, forcing, profiler
        self.cap, self.flexible = cap, flexible

    def direction(self, dv, g):
        """p (n, d) [m/s]."""
        rule = CGOptions(self.forcing.relative_tolerance(g), self.cap, self.flexible)
        return solve(self.linearise(dv), -g, rule, self.profiler)

    def update(self, s, y, full=True):
        """Do nothing: each direction takes a new Hessian."""

    def restart(self):
        """Return False: the Hessian was that of the iterate."""
        return False
