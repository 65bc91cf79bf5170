"""The accepted step: solved tightly, with a bar for all that the scene's own tolerance admits.

An accepted increment is any with ||g^||_2 <= eps sqrt(n) (HOT-eq9). Two correct codes differ by all
that this admits: to first order dv is off by H^-1 g, so that its entry i may be off by

    eps sqrt(n) ||row i of H^-1 K||_2,        K = diag(kappa),

since a gradient may be concentrated where it hurts entry i most. The norms of the rows, and of what
follows linearly from dv, are those of H^-1 K z over random z of unit variance.

As it stands this admits any velocity at the rim, where a node has a millionth of the matter but the
kappa of its stiffness. No code leaves such a gradient there: a gradient is a sum over the node's
particles, and what a solve leaves of the energy g.H^-1 g is spread over all nodes. So the gradient
of a node counts at most by sqrt(D_i / mean D), D the size of its diagonal block: then all nodes may
hold as much energy. It is an assumption, and each file tests it on two methods.
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
from .error_bounds import size, spread_of
from .implicit_stages import after

CLOSER = 1e-3       # the golden increment's tolerance, of the scene's
ROOM = 2.0          # others may be so much farther off than the two methods seen
SAMPLES = 16        # of the increments that a tolerance admits
TIGHT = 0.03        # of the linear solves, in the energy: samples are worth no more
FAR = 4.0           # bars: two solutions farther apart are not the same minimum


class Solved(NamedTuple):
    """The accepted increment of a step."""

    dv: np.ndarray          # (n, d) [m/s]  to CLOSER times the tolerance
    S: np.ndarray           # (n,)          its scale of round-off [m/s]
    bar: np.ndarray         # (n,)          how far the tolerance lets others be from it [m/s]
    near: float             # largest distance of what the scene's method accepts
    second: float           # and of what another method finds
    samples: list           # increments that the tolerance admits, one standard deviation each
    factor: float           # from deviations to bars
    report: object          # of the scene's method
    pose: object            # whose planes bear as in the end


def solve(stepper, bodies, dt, S_g, t):
    """`Solved` of a step from time t. Raises ValueError where the step is not solved."""
    options = stepper.options
    pose, accepted = accepted_by(stepper, bodies, (t, dt), options)
    report = stepper.report
    if not report.converged:
        raise ValueError(f"the implicit step was not solved: {report.message}; take a smaller dt, "
                         "another method, a larger eps, or more iterations")
    tight = replace(options, eps=CLOSER * options.eps, displacement_tolerance=0.0,
                    max_iterations=10_000)
    pose, dv = tightly(stepper, bodies, (t, dt), tight)
    second = tightly(stepper, bodies, (t, dt), other_method(options, tight.eps))[1]
    system = stepper.system(pose)
    A = system.matrix(dv)
    weight, factor = admitted(options, pose.kappa, A)
    samples = increments(system, A, weight, 1)
    bar = factor * spread_of([size(s) for s in samples])
    rounded = increments(system, A, S_g, 2)
    S = size(dv) + spread_of([size(s) for s in rounded])
    near, again = (abs(u - dv) for u in (accepted, second))
    worst = max(ratio(size(off), bar + 8 * np.finfo(float).eps * S) for off in (near, again))
    if worst > FAR:
        raise ValueError(f"two solutions of the step are {worst:.2g} times farther apart than its "
                         f"tolerance eps = {options.eps:.3g} explains; take a smaller dt")
    bar, factor = max(ROOM * worst, 1.0) * bar, max(ROOM * worst, 1.0) * factor
    return Solved(dv, S, bar, float(near.max()), float(again.max()), samples, factor, report, pose)


def tightly(stepper, bodies, when, options):
    """`accepted_by`, for options whose tolerance is far below the scene's. Raises ValueError where
    it is not met.
    """
    found = accepted_by(stepper, bodies, when, options)
    if not stepper.report.converged:
        raise ValueError(f"{options.method} did not solve the step to {options.eps:.2g}, which the "
                         f"oracle needs: {stepper.report.message}; record to a larger eps")
    return found


def accepted_by(stepper, bodies, when, options):
    """(`Pose` as its planes bear in the end, increment) that a method accepts."""
    before, stepper.options = stepper.options, options
    try:
        pose = stepper.problem(bodies, *when)
        dv = stepper.solve(pose)
    finally:
        stepper.options = before
    if pose.active_set is not None:
        pose = pose._replace(unknowns=pose.active_set.apply(pose.unknowns))
    return pose, dv


def other_method(options, eps):
    """`SolverOptions` of an unrelated method: Newton beside L-BFGS and ADMM,
    L-BFGS beside Newton. The coarsest level is solved directly: CG bears no V-cycle that varies.
    """
    word = "hot" if options.descent == "newton" else "pn-mgpcg"
    other = replace(METHODS[word], implementation=options.implementation, start=options.start,
                    cycle=CycleOptions(coarsest="direct"))
    if options.norm == "L2":
        return replace(other, norm="L2", eps=eps)
    return replace(other, eps=eps)


def ratio(a, b):
    """Largest a / b."""
    return float((a / np.maximum(b, np.finfo(float).tiny)).max())


def bars(problem, copies, pose, solved, dt):
    """{key: bar} of what follows from the accepted velocities: the deviations of each admitted
    increment, carried through grid to particles, return map and stress.

    copies() are the bodies before that.
    """
    v = pose.unknowns.v + solved.dv
    here = after(problem, copies(), pose, v, dt)
    moves = {key: [] for key in here}
    for s in solved.samples:
        there = after(problem, copies(), pose, v + s, dt)
        for key, a in there.items():
            moves[key].append(size((a - here[key])[:, None]))
    return {key: solved.factor * spread_of(m) for key, m in moves.items()}


def options_of(problem):
    """The options of an implicit problem's solver."""
    return SolverOptions() if problem.solver is None else problem.solver


# what a tolerance admits

def solver(A, index, levels=3):
    """b -> A^+ b by CG with the V-cycle, for many right-hand sides."""
    cycle = hierarchy(A, index, levels, coarsest="direct").cycle
    rule = CGOptions(lambda size: TIGHT)
    return lambda b: pcg(matrix_product(A), b, cycle, rule).x


def increments(system, A, weight, seed):
    """SAMPLES random increments (n, d) [m/s]: A^+ of gradients with the sizes weight (n,)."""
    rng, solve = np.random.default_rng(seed), solver(A, system.index)
    return [solve(system.project(weight[:, None] * rng.normal(size=system.start.shape)))
            for _ in range(SAMPLES)]


def admitted(options, kappa, A):
    """(weights (n,) [kg m/s], factor): the gradients that the tolerance of the options admits, for
    the Hessian A, are those of ||g / weights||_2 <= factor.
    """
    D = size(diagonal_blocks(A))
    share = np.minimum(1.0, np.sqrt(D / D.mean()))
    if options.norm == "L2":
        return options.eps * share, 1.0
    return options.eps * kappa * share, np.sqrt(len(kappa))
