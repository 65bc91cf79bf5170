"""A stopping rule for the particles' displacement: its error in cells, not the gradient's size.

At one tolerance of the gradient the methods leave errors of displacement that differ many times
over (`trade.hot.bar`). So the end of a method is checked by one more step of Newton,

    H e = -g    at the iterate, about, by CG with multigrid as preconditioner,

which is the error to first order, measured on the particles:

    particle error = SAFETY max_p |sum_i w_ip e_i| dt / dx <= displacement tolerance

Two things have made e too short, so that errors passed without a report.

The Hessian without its negative eigenvalues is too stiff: on HOT's Twist its step was a quarter to
an eighth of the error, however well CG solved for it. So H is the exact Hessian. Where it is not
positive along a direction of CG the iterate is near no minimum, and the check tells nothing.

CG finds stiff modes first and soft ones last, in which particles move far: on Wheel and Donut e had
a tenth of its length or less after 50 iterations. The residual does not show that, the energy does:

    e.H e after k iterations, less that after k / 2: what the second half of them has found

CG ends where this is at most SETTLED of the whole, or sooner where e is too long already.

The step is taken whatever it says. If it is too long, the method goes on with a smaller tolerance
of the gradient. Modes of nodes of next to no mass, which the gradient's norm counts and which take
most iterations at small tolerances, count for little here: particles hardly feel them.
"""

from dataclasses import replace
from math import inf

from .descent import iterate
from .krylov import CGOptions
from .line_search import search
from .linearization import Linearization, initial_inverse, solve
from .norms import scaled_norm

REFUSED_STEP = ("the line search refused the step that would tell more, near the limit of "
                "round-off or where the energy is no number")
SAFETY = 3.0                # the estimate falls short of the error by less than this in nearly all
                            # states; trade.hot.held says in how many, and by how much not
ROUNDS = 12                 # of a method and a check, at most
FACTORS = (1e-2, 0.5)       # by which the gradient's tolerance falls from round to round
CHECK = 0.02                # tolerance of CG, if it gets there
FEWEST = 50                 # iterations of CG in a check that does not meet CHECK: 16 let more
                            # errors pass, where nodes at the rim make CG slow
SETTLED = 0.25              # share of e.H e; on Wheel a share of 0.3 to 0.5 was found by the second
                            # half of the iterations as long as e was too short


def iterate_to_displacement(system, start, steps, stop, options, profiler):
    """Iterate from start (n, d) until the error of displacement is small; return (`Iterate`, None)
    or (its, message).

    steps are advance(`Iterate`), as for `descent.iterate`, and inverse(dv) -> the preconditioner of
    the check at an increment; stop.eps is the first tolerance of the gradient.
    """
    advance, inverse = steps
    for _ in range(ROUNDS):
        before = len(profiler.residuals)
        point, message = iterate(system, start, advance, stop, profiler)
        better = newton_check(system, point, inverse(point.dv), options, profiler)
        if better is None:
            return point, failure_message(profiler.particle_error, options,
                                          message or REFUSED_STEP)
        if profiler.particle_error <= options.displacement_tolerance or message is not None:
            profiler.record(scaled_norm(better.g, system.kappa))
            return better, failure_message(profiler.particle_error, options, message)
        start = better.dv
        factor = tolerance_factor(options.displacement_tolerance / profiler.particle_error)
        steps = len(profiler.residuals) - before
        stop = stop._replace(eps=stop.eps * factor, max_iterations=stop.max_iterations - steps)
        if stop.max_iterations < 0:
            break
    return better, failure_message(profiler.particle_error, options,
                                   f"{options.max_iterations} iterations, {ROUNDS} checks")


class CheckEnd:
    """When CG of a check ends before its tolerance: the step has become longer than allowed, in
    particles' displacement [dx], or its energy, that of the exact step less that of its error,
    has settled.

    It looks after FEWEST iterations and whenever their number has doubled.
    """

    def __init__(self, displacement, longest):
        self.displacement, self.longest = displacement, longest
        self.next, self.energy = FEWEST // 2, 0.0

    def __call__(self, x, k, energy):
        """Return whether CG ends after k iterations with x (n, d) [m/s], of the energy [J]."""
        if k < self.next:
            return False
        gained, self.energy, self.next = energy - self.energy, energy, 2 * k
        settled = gained <= SETTLED * energy
        return k >= FEWEST and (settled or self.displacement(x) > self.longest)


def newton_check(system, point, inverse, options, profiler):
    """Return the `Iterate` after a step of Newton, or None if the line search refuses it.

    Sets profiler.particle_error [dx], the estimate of the error of the given iterate; inf where CG
    had to end early, which tells nothing.
    """
    enough = CheckEnd(system.particle_displacement, options.displacement_tolerance / SAFETY)
    rule = CGOptions(lambda size: CHECK, options.max_cg_iterations, flexible=True, enough=enough)
    linear, capped = Linearization(system.product(point.dv, False), inverse), profiler.capped_solves
    e = system.project(solve(linear, -point.g, rule, profiler))
    ended = profiler.capped_solves == capped
    profiler.particle_error = SAFETY * system.particle_displacement(e) if ended else inf
    found = search(system, point, e, options.search)
    profiler.backtracks += found.backtracks
    return found.point


def tolerance_factor(wanted):
    """Factor of the gradient's tolerance that should lower the error by the factor wanted."""
    least, most = FACTORS
    return min(max(wanted, least), most)


def failure_message(error, options, reason):
    """Return why an error exceeds its tolerance, None if it does not."""
    if error <= options.displacement_tolerance:
        return None
    return (f"particles may still be off by {error:.2g} dx, "
            f"{options.displacement_tolerance:g} were asked: {reason}")


def lazy_v_cycle(system, options, profiler):
    """Return the function dv -> V-cycle, of the Hessian at the dv of the first call."""
    cycle = replace(options, descent="lbfgs", inverse="cycle", operator="matrix")
    cached = []

    def of_first(dv):
        if not cached:
            cached.append(initial_inverse(system, cycle, profiler)(dv).inverse)
        return cached[0]
    return of_first
