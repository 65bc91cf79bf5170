"""Measure the cost of an implicit step, part by part, on two given steps.

`twist` is the bar of Figure 20 with a middle of 1e9 Pa in its fourth step, 13 000 particles; `box`
is the first step of Figure 18, 33 000 particles each stretched at random. Times are CPU seconds of
all threads, alternatives are timed in turn, and results are medians of the rounds.
"""

from functools import partial
from time import process_time
from typing import NamedTuple

import numpy as np

from mpm_ref.hot.methods import minimise, printed
from mpm_ref.hot.multigrid.blocks.product import planes_of, product
from mpm_ref.hot.multigrid.blocks.sparse import blocks_of
from mpm_ref.hot.multigrid.hierarchy import hierarchy
from mpm_ref.hot.multigrid.options import CycleOptions
from validation.hot.linear_system import CGLimits, frozen
from validation.hot.one_step import ImplicitStep, step_after
from validation.hot.preconditioners import OURS, cost, one_thread
from validation.hot.stiffness import bar
from validation.hot.stretched_box import FRAME, stretched

THEIRS = "aggregation-rigid"        # pyamg's, of `validation.hot.preconditioners`
METHODS = {                         # the first is what the others are relative to
    "hot": ("hot", {}),
    "hot, smoothers in single precision": ("hot", {"cycle": CycleOptions(precision="single")}),
    "hot-plus": ("hot-plus", {}),
    "lbfgs-h": ("lbfgs-h", {}),
    "pn-pcg": ("pn-pcg", {}),
}


class Part(NamedTuple):
    """A function to be timed, and the unit to which its time refers."""

    run: callable
    per: str            # "particle" or "node"


def twist(dx=0.0228):
    """`Step` of the twisted bar."""
    return step_after(bar(dx, 1e9, "hot", 3), 3)


def box(dx=1.0 / 16.0):
    """Return the `Step` of the stretched box."""
    problem = stretched("particle", dx)
    stepper = problem.stepper()
    pose = stepper.problem(problem.bodies, 0.0, FRAME)
    return ImplicitStep(problem.bodies, stepper, pose, FRAME, 0.0)


STEPS = {"twist": twist, "box": box}


def parts(step):
    """Return the parts of a step at its start, as {name: `Part`}."""
    system, potential = system_of(step), step.pose.potential
    dv, (_, g) = system.start, system.evaluate(system.start)
    tangent, A = potential.tangent(dv), system.matrix(dv)
    planes = planes_of(blocks_of(A))
    grids, single = (hierarchy(A, system.index, precision=p) for p in ("double", "single"))
    return {
        "energy and gradient": Part(lambda: potential.evaluate(dv), "particle"),
        "tangent": Part(lambda: potential.tangent(dv), "particle"),
        "product without a matrix": Part(lambda: tangent.product(g), "particle"),
        "matrix": Part(tangent.matrix, "particle"),
        "product": Part(lambda: product(planes, g), "node"),
        "product by SciPy": Part(lambda: A @ g.reshape(-1), "node"),
        "hierarchy": Part(lambda: hierarchy(A, system.index), "node"),
        "cycle": Part(lambda: grids.cycle(g), "node"),
        "cycle, smoothers in single precision": Part(lambda: single.cycle(g), "node"),
    }


def system_of(step):
    """Return a new `System` of a step, without cached matrices."""
    return step.stepper.system(step.pose)


def in_turn(functions, repeats):
    """Call functions in turn and return {name: results}; the first round compiles."""
    rounds = [{name: run() for name, run in functions.items()} for _ in range(repeats + 1)]
    return {name: [done[name] for done in rounds[1:]] for name in functions}


def cpu(run):
    """Return the CPU seconds of a call."""
    start = process_time()
    run()
    return process_time() - start


def cost_rows(step, repeats):
    """Return a row for every part: median ns per particle or node."""
    functions = parts(step)
    counts = counts_of(step)
    times = in_turn({name: partial(cpu, part.run) for name, part in functions.items()}, repeats)
    return [{"part": name, "per": part.per,
             "cpu_ns": 1e9 * float(np.median(times[name])) / counts[part.per]}
            for name, part in functions.items()]


def counts_of(step):
    """Return the numbers of particles and nodes of a step."""
    return {"particle": sum(len(body.id) for body in step.bodies),
            "node": len(step.pose.unknowns.m)}


def method_rows(step, repeats):
    """Return a row for every method: median CPU seconds of the step and of its parts."""
    def solve(method, changes):
        return minimise(system_of(step), printed(method, **changes)).report
    reports = in_turn({name: partial(solve, *choice) for name, choice in METHODS.items()}, repeats)
    rows = [method_row(name, done) for name, done in reports.items()]
    return [row | {"cpu_ratio": row["cpu_s"] / rows[0]["cpu_s"]} for row in rows]


def method_row(name, reports):
    """Return the row of a method: iterations of the last report, median CPU seconds of all."""
    last = reports[-1]
    return {
        "method": name, "converged": last.converged, "iterations": last.iterations,
        "cg": last.cg_iterations, "evaluations": last.evaluations,
        "cpu_s": float(np.median([sum(r.seconds.values()) for r in reports])),
        "parts_s": {part: float(np.median([r.seconds[part] for r in reports]))
                    for part in last.seconds},
    }


def solver_rows(step, repeats):
    """Return rows for CG to 1e-6 on the step's matrix with our V-cycle and smoothed aggregation.

    They hold median CPU seconds of set-up and solve, on one thread like pyamg.
    """
    system = system_of(step)
    A, (_, g) = system.matrix(system.start), system.evaluate(system.start)
    matrix = frozen(A, system.index, -g, counts_of(step)["particle"])
    np.random.seed(0)               # noqa: NPY002  pyamg draws from it to estimate eigenvalues
    with one_thread():
        costs = in_turn({case: partial(cost, matrix, case, CGLimits()) for case in (OURS, THEIRS)},
                        repeats)
    rows = [{"solver": case, "iterations": done[-1].iterations, "converged": done[-1].converged,
             "setup_s": float(np.median([c.setup for c in done])),
             "cpu_s": float(np.median([c.total for c in done]))} for case, done in costs.items()]
    return [row | {"cpu_ratio": row["cpu_s"] / rows[0]["cpu_s"]} for row in rows]


def costs(names, repeats):
    """Return all rows of the named steps."""
    rows = []
    for name in names:
        step = STEPS[name]()
        counts = counts_of(step)
        where = {"step": name, "particles": counts["particle"], "nodes": counts["node"]}
        for make in (cost_rows, method_rows, solver_rows):
            rows += [where | row for row in make(step, repeats)]
    return rows
