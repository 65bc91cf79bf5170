"""Methods, each with its ladder of tolerances, that solve a step at equal error.

All take turns, so that the load of the machine bears on all alike, and each goes down its ladder
until a solve is cut short or slow: the next would be so too.
"""

from itertools import zip_longest
from typing import NamedTuple

from ..hot.stiffness import METHODS
from .hot import PAPER, point

SOME = (*METHODS, "hot-plus")
ALL = (*SOME, "hot-quadratic", "lbfgs-gmg", "sgs-pcg", "pn-gmg-pcg", "admm", "gast15")
FLEXIBLE = {"flexible": True}       # CG bears a preconditioner that varies, as a V-cycle does whose
                                    # coarsest solve is inexact; plain CG takes thousands of
                                    # iterations near the solution
OPTIONS = {"pn-mgpcg": FLEXIBLE, "pn-gmg-pcg": FLEXIBLE}
OWN = {"gast15": tuple(10.0**-k for k in range(-1, 6))}     # its tolerance is an L2 norm [kg m/s]
CAPS = {"max_iterations": 300, "max_cg_iterations": 3000}   # one that is cut short says so
SLOW = 10.0                         # CPU time from which on a solve is its ladder's last [s]


class ToleranceLadder(NamedTuple):
    """A method, and the tolerances that it is given, largest first."""

    method: str
    ladder: tuple

    @property
    def options(self):
        """Of its solves, beside the tolerance."""
        return {**CAPS, **OPTIONS.get(self.method, {})}


def tolerance_ladders(methods, ladder):
    """Return the ladders of methods: one for all but where a tolerance means something else."""
    return [ToleranceLadder(method, OWN.get(method, ladder)) for method in methods]


def descended(step, exact, tried):
    """`Point`s of all `ToleranceLadder`s tried, beside the exact `Solution`."""
    found, ended = [], set()
    for rung in zip_longest(*(ladder.ladder for ladder in tried)):
        for ladder, eps in zip(tried, rung, strict=True):
            if eps is None or ladder.method in ended:
                continue
            found.append(point(step, exact, (ladder.method, eps), 1, **ladder.options))
            if last(found[-1]):
                ended.add(ladder.method)
    return found


def last(p):
    """Return whether a `Point` is its ladder's last. HOT goes on to the paper's tolerance, at
    which all are compared to it.
    """
    return (not p.converged or p.cpu > SLOW) and (p.method != "hot" or p.eps <= PAPER)
