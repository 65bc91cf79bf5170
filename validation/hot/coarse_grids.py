"""Figure 19: node embedding against geometric multigrid, on ArmaCat, in Newton's CG and in L-BFGS.

CG iterations are counted on the finest level. The cycle's coarsest solve is inexact, so that it is
not the same linear map each time; CG that allows for this ("flexible") is shown beside plain CG,
which the paper and its release take.
"""

from typing import NamedTuple

from mpm_ref.scene import build

from ..common.registry import experiment
from .iterates import COLUMNS, EPS, Way, first, iterates, ways
from .warm_states import BEGUN, begun, particles, scene, steps

JACOBI, OURS, GEOMETRIC = "pn-pcg", "pn-mgpcg", "pn-gmg-pcg"
NEWTONS = (*ways(JACOBI, OURS, GEOMETRIC),
           *(Way(f"{m}-flexible", m, {"flexible": True}) for m in (OURS, GEOMETRIC)))
DESCENTS = ways("hot", "lbfgs-gmg")
SOFT = ("sauce", "faceless")            # the two scenes of soft matter alone
ELSEWHERE = (*SOFT, "wheel")
CAT = "armacat_stiff"
CAP = 300                               # iterations of L-BFGS


class Cost(NamedTuple):
    """What one step took by one method."""

    scene: str
    step: int
    method: str
    iterations: int
    cg: int
    cpu: float          # [s]
    converged: bool


@experiment("hot.fig19", title="ArmaCat: geometric and node-embedding multigrid",
            profiles=("quick", "standard", "paper"),
            budget={"quick": 15, "standard": 500, "paper": 14400})
def coarse_grids(run):
    """CG by residual in one step, and by step; L-BFGS with either multigrid."""
    one = first(build(scene(CAT, "quick")))
    for way in (*NEWTONS, *DESCENTS):
        iterates(one, way, max_iterations=2)                        # compiles
    costs, rows = [], []
    problem, coming = armacat(run)
    scale = f"{particles(problem)} particles (the paper: 403 000)"
    for k, step in enumerate(coming):
        for way in run.progress((*NEWTONS, *DESCENTS), f"step {k}"):
            made = iterates(step, way, max_iterations=CAP)
            costs.append(cost(CAT, k, way, made))
            if k == 0:
                rows += [(way.name, *row) for row in made.rows]
    record_step(run, [c for c in costs if c.step == 0], scale)
    record_all(run, costs, scale)
    costs += elsewhere(run)
    run.table("iterates", COLUMNS, rows)
    run.table("costs", Cost._fields, costs)


def armacat(run):
    """(`Problem`, its `Step`s): from the fall, or after the landing."""
    if run.profile == "quick":
        problem = build(scene(CAT, "quick"))
        return problem, [first(problem)]
    problem, state = begun(CAT, run.profile)
    return problem, steps(problem, state, 10)


def cost(name, k, way, made):
    """`Cost` of a solve."""
    r = made.report
    return Cost(name, k, way.name, r.iterations, r.cg_iterations, r.cpu_times[-1], r.converged)


def total(costs, method, field="cg"):
    """Sum of a field over the steps of a method."""
    return sum(getattr(c, field) for c in costs if c.method == method)


def record_step(run, costs, scale):
    """Gains in CG iterations in one step: the printed ones."""
    jacobi = total(costs, JACOBI)
    for target, method in (("gmg_gain", GEOMETRIC), ("ours_gain", OURS)):
        plain, flexible = total(costs, method), total(costs, f"{method}-flexible")
        run.record(f"hot.fig19.{target}", jacobi / plain, scale=scale,
                   note=f"in one step to eps = {EPS:g}: {jacobi} CG iterations by Jacobi, {plain}; "
                   f"{flexible} by flexible CG")


def record_all(run, costs, scale):
    """CG iterations and times over all steps."""
    count = 1 + max(c.step for c in costs)
    where = f"{scale}, {times(count)}"
    for way in NEWTONS:
        run.record(f"hot.fig19.{way.name}.cg", total(costs, way.name) / count, comparator="info",
                   scale=where, note=f"per step; {total(costs, way.name, 'cpu') / count:.3f} CPU "
                   f"seconds, {total(costs, way.name, 'iterations') / count:.1f} Newton steps"
                   + ("" if all_converged(costs, way.name) else "; not every step converged"))
    slowest = max(total(costs, m, "cpu") for m in (JACOBI, OURS))
    run.record("hot.fig19.time_vs_gmg", total(costs, GEOMETRIC, "cpu") / slowest, scale=where,
               note="CPU time by geometric multigrid over that of the slower of Jacobi and ours")
    record_lbfgs(run, CAT, costs, where)


def all_converged(costs, method):
    """Whether every step of a method did."""
    return all(c.converged for c in costs if c.method == method)


def elsewhere(run):
    """`Cost`s of L-BFGS with either multigrid on other scenes."""
    count, costs = run.choose(quick=1, standard=5, paper=5), []
    for name in ELSEWHERE:
        problem, state = begun(name, run.profile)
        new = [cost(name, k, way, iterates(step, way, max_iterations=CAP))
               for k, step in enumerate(steps(problem, state, count)) for way in DESCENTS]
        record_lbfgs(run, name, new, f"{particles(problem)} particles, {times(count)} "
                     f"from {BEGUN[name]:g} s on")
        costs += new
    slower = [ratio([c for c in costs if c.scene == name], "cpu") for name in SOFT]
    run.record("hot.fig19.lbfgs_gmg_soft", min(slower), unit="1", comparator="info",
               scale=f"{times(count)} each",
               note="the smaller of both scenes' ratios of CPU time, LBFGS-GMG over HOT")
    return costs


def times(count):
    """A number of steps in words."""
    return f"{count} step{'s' * (count > 1)}"


def ratio(costs, field):
    """LBFGS-GMG over HOT."""
    return total(costs, "lbfgs-gmg", field) / total(costs, "hot", field)


def record_lbfgs(run, name, costs, scale):
    """Iterations of LBFGS-GMG over HOT's."""
    missed = [f"; {m} did not converge in every step" for m in ("hot", "lbfgs-gmg")
              if not all_converged(costs, m)]
    run.record(f"hot.fig19.{name}.lbfgs_gmg.iterations", ratio(costs, "iterations"),
               comparator="info", scale=scale, note="outer iterations, LBFGS-GMG over HOT's "
               f"{total(costs, 'hot', 'iterations')}; CPU time {ratio(costs, 'cpu'):.2f} times "
               "HOT's" + "".join(missed))
