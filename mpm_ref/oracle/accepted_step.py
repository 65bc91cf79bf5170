"""The accepted step of an implicit solve: solved accurately, with an error bar for the tolerance.

Every increment with ||g^||_2 <= eps sqrt(n) is accepted (HOT-eq9). Two correct codes differ by all
that this admits: to first order dv is off by H^-1 g, so that its entry i may be off by

    eps sqrt(n) ||row i of H^-1 K||_2,        K = diag(kappa),

since a gradient may be concentrated where it affects entry i most. The norms of the rows, and of
what follows linearly from dv, are those of H^-1 K z over random z of unit variance.

As it stands this admits any velocity at the rim, where a node has a millionth of the matter but the
kappa of its stiffness. No code leaves such a gradient there: a gradient is a sum over the node's
particles, and the energy g.H^-1 g that remains after a solve is spread over all nodes. So the
gradient of a node counts at most by sqrt(D_i / mean D), D the size of its diagonal block: then all
nodes may hold the same energy. This is an assumption, and each file tests it on two methods.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ..hot.krylov import CGOptions, pcg
from ..hot.linearization import matrix_product
from ..hot.methods import METHODS, SolverOptions
from ..hot.multigrid.hierarchy import hierarchy
from ..hot.multigrid.options import CycleOptions
from ..hot.multigrid.projectors import diagonal_blocks
from .error_bounds import rms_spread, size
from .kernel_stages import solved_stages

GOLDEN_EPS = 1e-3       # tolerance of the golden increment, in units of the scene's
MARGIN = 2.0            # of the bar over the distances between the methods tried
SAMPLES = 16            # number of increments that a tolerance admits
CG_TOLERANCE = 0.03     # of linear solves for the samples, in the energy: they need no better
MOST_BARS = 4.0         # two solutions that are farther apart are not the same minimum


class AcceptedStep(NamedTuple):
    """The accepted increment of a step, with its errors."""

    dv: np.ndarray          # (n, d) [m/s]  solved to GOLDEN_EPS times the tolerance
    S: np.ndarray           # (n,)          its scale of round-off [m/s]
    bar: np.ndarray         # (n,)          largest distance that the tolerance admits [m/s]
    error_method: float     # largest distance to the increment that the scene's method accepts
    error_second: float     # largest distance to the solution by a second method
    samples: list           # increments that the tolerance admits, one standard deviation each
    factor: float           # from deviations to bars
    report: object          # of the scene's method
    step_problem: object    # `hot.step.ImplicitProblem`, with the planes that bear in the end


def solve(stepper, bodies, dt, S_g, t):
    """Return the `AcceptedStep` from time t, for a gradient with the scale of round-off S_g (n,).

    Raises ValueError if the step is not solved.
    """
    options = stepper.options
    step_problem, accepted = solve_with(stepper, bodies, (t, dt), options)
    report = stepper.report
    if not report.converged:
        raise ValueError(f"the implicit step was not solved: {report.message}; take a smaller dt, "
                         "another method, a larger eps, or more iterations")
    tight = replace(options, eps=GOLDEN_EPS * options.eps, displacement_tolerance=0.0,
                    max_iterations=10_000)
    step_problem, dv = solve_tightly(stepper, bodies, (t, dt), tight)
    second = solve_tightly(stepper, bodies, (t, dt), second_method(options, tight.eps))[1]
    system = stepper.system(step_problem)
    A = system.matrix(dv)
    weight, factor = admitted_gradients(options, step_problem.kappa, A)
    samples = random_increments(system, A, weight, 1)
    bar = factor * rms_spread([size(s) for s in samples])
    rounded = random_increments(system, A, S_g, 2)
    S = size(dv) + rms_spread([size(s) for s in rounded])
    errors = [abs(u - dv) for u in (accepted, second)]
    worst = max(largest_ratio(size(error), bar + 8 * np.finfo(float).eps * S) for error in errors)
    if worst > MOST_BARS:
        raise ValueError(f"two solutions of the step are {worst:.2g} times farther apart than its "
                         f"tolerance eps = {options.eps:.3g} explains; take a smaller dt")
    bar, factor = max(MARGIN * worst, 1.0) * bar, max(MARGIN * worst, 1.0) * factor
    return AcceptedStep(dv, S, bar, *(float(error.max()) for error in errors), samples, factor,
                        report, step_problem)


def solve_tightly(stepper, bodies, when, options):
    """Return the result of `solve_with`, for a tolerance far below the scene's.

    Raises ValueError if the method does not meet it.
    """
    solution = solve_with(stepper, bodies, when, options)
    if not stepper.report.converged:
        raise ValueError(f"{options.method} did not solve the step to {options.eps:.2g}, which the "
                         f"oracle needs: {stepper.report.message}; record to a larger eps")
    return solution


def solve_with(stepper, bodies, when, options):
    """Return (`ImplicitProblem`, increment) that a method accepts, when = (t, dt).

    The problem has the planes that bear in the end.
    """
    own_options, stepper.options = stepper.options, options
    try:
        step_problem = stepper.problem(bodies, *when)
        dv = stepper.solve(step_problem)
    finally:
        stepper.options = own_options
    if step_problem.active_set is not None:
        unknowns = step_problem.active_set.apply(step_problem.unknowns)
        step_problem = step_problem._replace(unknowns=unknowns)
    return step_problem, dv


def second_method(options, eps):
    """Return the `SolverOptions` of an unrelated method: L-BFGS for Newton, Newton for the others.

    The coarsest level is solved directly: CG needs a V-cycle that does not vary.
    """
    name = "hot" if options.descent == "newton" else "pn-mgpcg"
    other = replace(METHODS[name], implementation=options.implementation, start=options.start,
                    balance=options.balance, cycle=CycleOptions(coarsest="direct"))
    if options.norm == "L2":
        return replace(other, norm="L2", eps=eps)
    return replace(other, eps=eps)


def largest_ratio(a, b):
    """Return the largest a / b of arrays a and b >= 0."""
    return float((a / np.maximum(b, np.finfo(float).tiny)).max())


def error_bars(problem, copies, step_problem, accepted, dt):
    """Return {key: bar} of the arrays that follow from the accepted velocities.

    The deviation of each admitted increment is carried through grid to particles, return map and
    stress. copies() returns the bodies before that, accepted is the `AcceptedStep`.
    """
    v = step_problem.unknowns.v + accepted.dv
    golden = solved_stages(problem, copies(), step_problem, v, dt)
    deviations = {key: [] for key in golden}
    for s in accepted.samples:
        arrays = solved_stages(problem, copies(), step_problem, v + s, dt)
        for key, a in arrays.items():
            deviations[key].append(size((a - golden[key])[:, None]))
    return {key: accepted.factor * rms_spread(m) for key, m in deviations.items()}


def solver_options(problem):
    """Return the options of an implicit problem's solver."""
    return SolverOptions() if problem.solver is None else problem.solver


# the increments that a tolerance admits

def linear_solver(A, index, levels=3):
    """Return the function b -> A^+ b, by CG with the V-cycle."""
    cycle = hierarchy(A, index, levels, coarsest="direct").cycle
    rule = CGOptions(lambda size: CG_TOLERANCE)
    return lambda b: pcg(matrix_product(A), b, cycle, rule).x


def random_increments(system, A, weight, seed):
    """Return SAMPLES increments A^+ g (n, d) [m/s] of random gradients g of sizes weight (n,)."""
    rng, apply_inverse = np.random.default_rng(seed), linear_solver(A, system.index)
    return [apply_inverse(system.project(weight[:, None] * rng.normal(size=system.start.shape)))
            for _ in range(SAMPLES)]


def admitted_gradients(options, kappa, A):
    """Return weights (n,) [kg m/s] and a factor: the admitted g have ||g / weights||_2 <= factor.

    kappa (n,) are the characteristic norms; A is the Hessian, whose diagonal blocks limit the
    gradient of a node.
    """
    D = size(diagonal_blocks(A))
    share = np.minimum(1.0, np.sqrt(D / D.mean()))
    if options.norm == "L2":
        return options.eps * share, 1.0
    return options.eps * kappa * share, np.sqrt(len(kappa))
