"""A stopping rule for the particles' displacement: its error in cells, not the gradient's size.

At one tolerance of the gradient the methods leave errors of displacement that differ many times
over (`trade.hot.bar`). So the end of a method is checked by one more step of Newton,

    H e = -g    at the iterate, about, by CG with multigrid as preconditioner,

which is the error to first order, measured on the particles:

    particle error = SAFETY max_p |sum_i w_ip e_i| dt / dx <= displacement tolerance

The step is taken whatever it says. If it is too long, the method goes on with a smaller tolerance
of the gradient. Modes of nodes of next to no mass, which the gradient's norm counts and which take
most iterations at small tolerances, count for little here: particles hardly feel them.
"""

from dataclasses import replace

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
CHECK = CGOptions(lambda size: 0.02, 50, flexible=True)     # a cap of 16 let more errors pass,
                            # where nodes at the rim make CG slow


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
        better = newton_check(system, point, inverse(point.dv), options.search, profiler)
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


def newton_check(system, point, inverse, rules, profiler):
    """Return the `Iterate` after a step of Newton, or None if the line search refuses it.

    Sets profiler.particle_error [dx], the estimate of the error of the given iterate.
    """
    linear, capped = Linearization(system.product(point.dv), inverse), profiler.capped_solves
    e = system.project(solve(linear, -point.g, CHECK, profiler))
    unsure = 2.0 if profiler.capped_solves > capped else 1.0      # CG ended early: e is too short
    profiler.particle_error = unsure * SAFETY * system.particle_displacement(e)
    found = search(system, point, e, rules)
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
