"""Figure 19: node embedding against geometric multigrid, on ArmaCat, in Newton's CG and in L-BFGS.

CG iterations are counted on the finest level. The cycle's coarsest solve is inexact, so that the
cycle is not the same linear map each time; CG that allows for this ("flexible") is compared with
plain CG, which the paper and its release take.
"""

from typing import NamedTuple

from mpm_ref.scene import build

from ..common.registry import experiment
from ..common.scenes import particle_count
from .iterates import COLUMNS, EPS, MethodSetup, initial_step, iterates, setups
from .warm_states import START_TIMES, following_steps, scene, warm_state

JACOBI, OURS, GEOMETRIC = "pn-pcg", "pn-mgpcg", "pn-gmg-pcg"
NEWTONS = (*setups(JACOBI, OURS, GEOMETRIC),
           *(MethodSetup(f"{m}-flexible", m, {"flexible": True}) for m in (OURS, GEOMETRIC)))
DESCENTS = setups("hot", "lbfgs-gmg")
SOFT = ("sauce", "faceless")            # the two scenes of soft matter alone
OTHER_SCENES = (*SOFT, "wheel")
CAT = "armacat_stiff"
CAP = 300                               # iterations of L-BFGS


class MultigridCost(NamedTuple):
    """The work of one step by one method."""

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
    """Record CG by residual in one step and by step, and L-BFGS with either multigrid."""
    one = initial_step(build(scene(CAT, "quick")))
    for setup in (*NEWTONS, *DESCENTS):
        iterates(one, setup, max_iterations=2)                      # compiles
    costs, rows = [], []
    problem, tried = armacat(run)
    scale = f"{particle_count(problem.bodies)} particles (the paper: 403 000)"
    for k, step in enumerate(tried):
        for setup in run.progress((*NEWTONS, *DESCENTS), f"step {k}"):
            descent = iterates(step, setup, max_iterations=CAP)
            costs.append(cost(CAT, k, setup, descent))
            if k == 0:
                rows += [(setup.name, *row) for row in descent.rows]
    record_step(run, [c for c in costs if c.step == 0], scale)
    record_all(run, costs, scale)
    costs += other_scenes(run)
    run.table("iterates", COLUMNS, rows)
    run.table("costs", MultigridCost._fields, costs)


def armacat(run):
    """Return the `Problem` and its `ImplicitStep`s: from the fall, or after the landing."""
    if run.profile == "quick":
        problem = build(scene(CAT, "quick"))
        return problem, [initial_step(problem)]
    problem, state = warm_state(CAT, run.profile)
    return problem, following_steps(problem, state, 10)


def cost(name, k, setup, descent):
    """Return the `MultigridCost` of step k of a scene, solved by a `MethodSetup`."""
    r = descent.report
    return MultigridCost(name, k, setup.name, r.iterations, r.cg_iterations, r.cpu_times[-1],
                         r.converged)


def total(costs, method, field="cg"):
    """Return the sum of a field over the steps of a method."""
    return sum(getattr(c, field) for c in costs if c.method == method)


def record_step(run, costs, scale):
    """Record the printed gains: in CG iterations in one step."""
    jacobi = total(costs, JACOBI)
    for target, method in (("gmg_gain", GEOMETRIC), ("ours_gain", OURS)):
        plain, flexible = total(costs, method), total(costs, f"{method}-flexible")
        run.record(f"hot.fig19.{target}", jacobi / plain, scale=scale,
                   note=f"in one step to eps = {EPS:g}: {jacobi} CG iterations by Jacobi, {plain}; "
                   f"{flexible} by flexible CG")


def record_all(run, costs, scale):
    """Record CG iterations and times over all steps."""
    count = 1 + max(c.step for c in costs)
    where = f"{scale}, {step_text(count)}"
    for setup in NEWTONS:
        cg, cpu, steps = (total(costs, setup.name, field) / count
                          for field in ("cg", "cpu", "iterations"))
        run.record(f"hot.fig19.{setup.name}.cg", cg, comparator="info", scale=where,
                   note=f"per step; {cpu:.3f} CPU seconds, {steps:.1f} Newton steps"
                   + ("" if all_converged(costs, setup.name) else "; not every step converged"))
    slowest = max(total(costs, m, "cpu") for m in (JACOBI, OURS))
    run.record("hot.fig19.time_vs_gmg", total(costs, GEOMETRIC, "cpu") / slowest, scale=where,
               note="CPU time by geometric multigrid over that of the slower of Jacobi and ours")
    record_lbfgs(run, CAT, costs, where)


def all_converged(costs, method):
    """Return whether every step of a method converged."""
    return all(c.converged for c in costs if c.method == method)


def other_scenes(run):
    """Return the costs of L-BFGS with either multigrid on other scenes."""
    count, costs = run.choose(quick=1, standard=5, paper=5), []
    for name in OTHER_SCENES:
        problem, state = warm_state(name, run.profile)
        new = [cost(name, k, setup, iterates(step, setup, max_iterations=CAP))
               for k, step in enumerate(following_steps(problem, state, count))
               for setup in DESCENTS]
        record_lbfgs(run, name, new, f"{particle_count(state.bodies)} particles, "
                     f"{step_text(count)} from {START_TIMES[name]:g} s on")
        costs += new
    slower = [ratio([c for c in costs if c.scene == name], "cpu") for name in SOFT]
    run.record("hot.fig19.lbfgs_gmg_soft", min(slower), unit="1", comparator="info",
               scale=f"{step_text(count)} each",
               note="the smaller of both scenes' ratios of CPU time, LBFGS-GMG over HOT")
    return costs


def step_text(count):
    """Return a number of steps as text."""
    return f"{count} step{'s' * (count > 1)}"


def ratio(costs, field):
    """Return the sum of a field by LBFGS-GMG over that by HOT."""
    return total(costs, "lbfgs-gmg", field) / total(costs, "hot", field)


def record_lbfgs(run, name, costs, scale):
    """Record the iterations of LBFGS-GMG over HOT's."""
    missed = [f"; {m} did not converge in every step" for m in ("hot", "lbfgs-gmg")
              if not all_converged(costs, m)]
    run.record(f"hot.fig19.{name}.lbfgs_gmg.iterations", ratio(costs, "iterations"),
               comparator="info", scale=scale, note="outer iterations, LBFGS-GMG over HOT's "
               f"{total(costs, 'hot', 'iterations')}; CPU time {ratio(costs, 'cpu'):.2f} times "
               "HOT's" + "".join(missed))
