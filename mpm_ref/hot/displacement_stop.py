"""A stop by what a step hands on: by how many cells its particles are still off.

The size of the gradient says little of that: at one tolerance the methods leave errors that differ
many times over (`trade.hot.bar`). So the end of a method is checked by one more step of Newton,

    H e = -g    at the iterate, about, by CG with multigrid as preconditioner,

which is the error to first order, seen where it matters, on the particles:

    off = SAFETY max_p |sum_i w_ip e_i| dt / dx <= cells

The step is taken whatever it says. If it is too long, the method goes on with a smaller tolerance
of the gradient. Modes of nodes of next to no mass, which the gradient's norm counts and which take
most iterations at small tolerances, count for little here: particles hardly feel them.
"""

from dataclasses import replace

from .descent import iterate
from .krylov import Rule
from .line_search import search
from .linearization import Linear, first_inverse, solve
from .norms import scaled_norm

REFUSED = ("the line search refused the step that would tell more, near the limit of round-off or "
           "where the energy is no number")
SAFETY = 3.0                # the estimate falls short of the error by less than this in nearly all
                            # states; trade.hot.held says in how many, and by how much not
ROUNDS = 12                 # of a method and a check, at most
FACTORS = (1e-2, 0.5)       # by which the gradient's tolerance falls from round to round
CHECK = Rule(lambda size: 0.02, 50, flexible=True)      # a cap of 16 let more errors pass, where
                            # nodes at the rim make CG slow


def held(system, advance, inverse, stop, options, watch):
    """(`Point`, why not held or None) of steps advance(`Point`), as `descent.iterate` takes them.

    inverse(dv) -> the preconditioner of the check at an increment; stop.eps is the first tolerance.
    """
    start = system.start
    for _ in range(ROUNDS):
        before = len(watch.residuals)
        point, why = iterate(system, start, advance, stop, watch)
        better = checked(system, point, inverse(point.dv), options.search, watch)
        if better is None:
            return point, short(watch.off, options, why or REFUSED)
        if watch.off <= options.cells or why is not None:
            watch.note(scaled_norm(better.g, system.kappa))
            return better, short(watch.off, options, why)
        start = better.dv
        stop = stop._replace(eps=stop.eps * factor(options.cells / watch.off),
                             iterations=stop.iterations - (len(watch.residuals) - before))
        if stop.iterations < 0:
            break
    return better, short(watch.off, options, f"{options.iterations} iterations, {ROUNDS} checks")


def checked(system, point, inverse, rules, watch):
    """The `Point` after a step of Newton, None if a line search refuses it; watch.off is how far
    the particles of the first one may be off [dx].
    """
    linear, capped = Linear(system.product(point.dv), inverse), watch.capped
    e = system.free(solve(linear, -point.g, CHECK, watch))
    unsure = 2.0 if watch.capped > capped else 1.0      # CG ended early: e is too short
    watch.off = unsure * SAFETY * system.cells(e)
    found = search(system, point, e, rules)
    watch.backtracks += found.backtracks
    return found.point


def factor(wanted):
    """Of the gradient's tolerance, to bring the error down by a factor that is wanted."""
    least, most = FACTORS
    return min(max(wanted, least), most)


def short(off, options, why):
    """Why an error is not held, None if it is."""
    if off <= options.cells:
        return None
    return f"particles may still be off by {off:.2g} dx, {options.cells:g} were asked: {why}"


def multigrid_once(system, options, watch):
    """dv -> a V-cycle of the Hessian where it is first asked for."""
    cycle = replace(options, descent="lbfgs", inverse="cycle", operator="matrix")
    kept = []

    def of_first(dv):
        if not kept:
            kept.append(first_inverse(system, cycle, watch)(dv).inverse)
        return kept[0]
    return of_first
