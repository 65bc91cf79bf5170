"""The increment that a solve of HOT begins with: none, as printed; the fall, as the release; or
that of the last step, which is what a run of smooth motions would suggest.

The last increment is taken node by node, zero where a node had no matter, and made admissible. All
three solve the same steps to the same tolerance, and are compared with what is nearly exact.
"""

import numpy as np

from mpm_ref.hot.methods import minimise, printed
from mpm_ref.hot.system import free_part

from ..common.registry import experiment
from ..hot.one_step import difference, solve_step
from ..hot.warm_states import START_TIMES, following_steps, warm_state

STARTS = ("zero", "gravity", "last")
EPS, EXACT = 1e-8, 1e-10
CAPS = {"max_iterations": 1000}
COLUMNS = ("scene", "step", "start", "cpu", "iterations", "cells", "converged")


@experiment("trade.hot.start", title="HOT: the start of a solve",
            profiles=("quick", "standard"), budget={"quick": 3, "standard": 300})
def start(run):
    """Compare the time from each start with that from zero, scene by scene."""
    names, count = run.choose(quick=(("sauce",), 2), standard=(tuple(START_TIMES), 4))
    rows = []
    for name in run.progress(names, "scenes"):
        found, scale = scene_rows(name, count)
        rows += found
        record_scene(run, name, found, scale)
    run.table("solves", COLUMNS, rows)


def scene_rows(name, count):
    """Solve `count` steps of a scene; the first only gives the second its last increment. Returns
    rows of `COLUMNS`, and the scale.
    """
    problem, state = warm_state(name, "quick")
    rows, last = [], None
    for k, step in enumerate(following_steps(problem, state, count)):
        exact = solve_step(step, "pn-mgpcg", eps=EXACT, flexible=True, **CAPS).dv
        if last is not None:
            rows += [(name, k, start, *solve(step, begin, exact))
                     for start, begin in start_increments(step, last).items()]
        last = step.pose.unknowns.index, exact
    return rows, f"{step.particles} particles, {count - 1} steps, eps = {EPS:g}"


def start_increments(step, last):
    """Return {start: increment (n, d)} of a step after one with the increments `last`."""
    q = step.pose.unknowns
    fall = np.broadcast_to(step.pose.gravity_increment, q.dv0.shape)
    return {"zero": q.dv0, "gravity": q.dv0 + free_part(q, fall),
            "last": q.dv0 + free_part(q, carry_increments(*last, q.index))}


def carry_increments(index, dv, new_index):
    """Return the increments dv of the nodes `index` at the nodes `new_index`; zero at new nodes."""
    by_node = dict(zip(map(tuple, index.tolist()), dv, strict=True))
    none = np.zeros(dv.shape[1])
    return np.array([by_node.get(tuple(node), none) for node in new_index.tolist()])


def solve(step, begin, exact):
    """Solve with HOT from an increment. Returns CPU seconds, iterations, error of displacement
    [dx], converged.
    """
    system = step.stepper.system(step.pose)
    system.start = begin
    found = minimise(system, printed("hot", eps=EPS, **CAPS))
    r = found.report
    return (sum(r.seconds.values()), r.iterations, difference(step, found.dv, exact)[1],
            r.converged)


def record_scene(run, name, rows, scale):
    """Record the times of the two others over that of zero, all steps together."""
    total = {start: sum(row[3] for row in rows if row[2] == start) for start in STARTS}
    for start in STARTS[1:]:
        own = [row for row in rows if row[2] == start]
        zero = [row for row in rows if row[2] == "zero"]
        run.record(f"trade.hot.start.{name}.{start}", total[start] / total["zero"],
                   comparator="info", scale=scale,
                   note=f"CPU time over that from zero, {total['zero']:.3f} s; iterations "
                   f"{[row[4] for row in own]} for {[row[4] for row in zero]}; errors at most "
                   f"{max(row[5] for row in own):.1e} for {max(row[5] for row in zero):.1e} dx"
                   + ("" if all(row[6] for row in own + zero) else "; not all converged"))
