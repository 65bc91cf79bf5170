"""Figures 15 and 11: the time of every method for the same steps of every scene, over HOT's.

All methods solve a step from the same state, then HOT's step is taken: methods left to themselves
would soon solve different problems. The paper's numbers are of whole runs at ten and more times the
particles. Tolerances are the printed ones, hence not equal errors: see `trade.hot.scenes`.
"""

from typing import NamedTuple

from mpm_ref.hot.methods import printed

from ..common import targets
from ..common.registry import experiment
from ..common.scenes import particle_count
from .one_step import solve_step, step_after
from .stiffness import bar
from .warm_states import PRINTED, QUICK, START_TIMES, following_steps, warm_state

FLEXIBLE = "pn-mgpcg-flexible"      # bears a preconditioner that varies, as the printed one does:
                                    # its coarsest level is solved by CG to a half
METHODS = ("hot", "hot-quadratic", "lbfgs-h", "pn-pcg", "pn-pcg-mf", "pn-mgpcg", FLEXIBLE,
           "lbfgs-gmg", "gast15")
ABLATION = ("pn-pcg", "pn-pcg-mf", "pn-mgpcg", "lbfgs-h")       # of section 7.2
EASY = ("armacat_soft", "sauce")            # its two exceptions, where HOT is not the fastest
SLOW_GMG = ("sauce", "faceless")            # where geometric multigrid is said to be twice as slow
PULLED = 49             # steps until the head is let go: that step crosses more than a cell
FACELESS = ("hot", "pn-pcg", "pn-pcg-mf")   # of Figure 11
STIFF, GOAL = 1e9, 15.0     # [Pa], and what a prototype of ours gained there over Gast15; not the
                            # paper's number


class MethodCost(NamedTuple):
    """The work of one step by one method."""

    scene: str
    method: str
    step: int
    t: float            # at its start [s]
    cpu: float          # [s]
    iterations: int     # outer
    inner: int          # of CG on the finest level
    coarse: int         # of CG on the coarsest level
    evaluations: int
    converged: bool


class Overview(NamedTuple):
    """The steps of a scene by one method, over HOT's."""

    scene: str
    method: str
    particles: int
    nodes: int
    steps: int
    total: float        # CPU time over HOT's
    worst: float        # CPU time over HOT's of the step where it is largest
    cpu: float          # [s] per step
    iterations: float   # per step
    inner: float        # per step
    capped: int         # steps that did not converge


def costs(step, about, methods, caps):
    """Return the `MethodCost` of each method for an `ImplicitStep`.

    about: its scene, number and time; caps: options that bound the work of Gast15, whose CG on
    stiff scenes would take minutes.
    """
    measured = []
    for method in methods:
        report = solve_step(step, solver(method), **options(method, caps)).report
        measured.append(MethodCost(
            about[0], method, *about[1:], sum(report.seconds.values()), report.iterations,
            report.cg_iterations, report.coarse_iterations, report.evaluations, report.converged))
    return measured


def solver(method):
    """Return what `solve_step` takes for a method of `METHODS`."""
    return printed("pn-mgpcg", flexible=True) if method == FLEXIBLE else method


def options(method, caps):
    """Return changes of a method's options: Gast15 has a tolerance of its own, and caps."""
    if method != "gast15":
        return {}
    return {"eps": targets.load()["hot.sec7_1.gast_tol"].value, **caps}


def scene_costs(name, profile, count, caps):
    """Return ([`MethodCost`], [`Overview`]) of the next `count` steps of a warm scene."""
    problem, state = warm_state(name, profile)
    return costs_of_steps(name, following_steps(problem, state, count), caps)


def costs_of_steps(name, steps, caps):
    """Return ([`MethodCost`], [`Overview`]) of some `ImplicitStep`s of a scene, each valid until
    the next.
    """
    rows = []
    for k, step in enumerate(steps):
        if k == 0:
            warm_up(step, METHODS)
        rows += costs(step, (name, k, step.t), METHODS, caps)
        size = step.particles, len(step.pose.unknowns.m)
    return rows, [overview(rows, method, *size) for method in METHODS]


def overview(rows, method, count, nodes):
    """Return the `Overview` of the rows of one scene."""
    ours, hot = ([r for r in rows if r.method == word] for word in (method, "hot"))
    ratios = [a.cpu / b.cpu for a, b in zip(ours, hot, strict=True)]
    cpu, n = sum(r.cpu for r in ours), len(ours)
    return Overview(ours[0].scene, method, count, nodes, n, cpu / sum(r.cpu for r in hot),
                    max(ratios), cpu / n, sum(r.iterations for r in ours) / n,
                    sum(r.inner for r in ours) / n, sum(not r.converged for r in ours))


def warm_up(step, methods):
    """Solve a step by all methods, cut short: first calls at a size compile or load kernels."""
    for method in methods:
        solve_step(step, solver(method), max_iterations=2, max_cg_iterations=20)


@experiment("hot.fig15", title="Speed-up overview: every method on every scene, over HOT's time",
            profiles=("quick", "standard", "paper"),
            budget={"quick": 15, "standard": 750, "paper": 36000})
def speedups(run):
    """Record total and worst-step time of all methods on all scenes, and the printed ranges."""
    names, count = run.choose(quick=(QUICK, 1), standard=(PRINTED, 3), paper=(PRINTED, 3))
    caps = run.choose(quick={"max_iterations": 15, "max_cg_iterations": 300},
                      standard={"max_iterations": 30, "max_cg_iterations": 1000}, paper={})
    rows, table = [], {}
    for name in run.progress(names, "scenes"):
        step_costs, overviews = scene_costs(name, run.profile, count, caps)
        rows += step_costs
        table[name] = {o.method: o for o in overviews}
        for o in overviews:
            record_overview(run, o)
    record_ranges(run, table)
    record_claims(run, table)
    record_stiff(run)
    run.table("steps", MethodCost._fields, rows)
    run.table("speedups", Overview._fields, [o for row in table.values() for o in row.values()])


def record_overview(run, o):
    """Record the total and the worst time of one method on one scene."""
    scale = (f"{o.particles} particles, {o.nodes} nodes; {o.steps} steps from "
             f"{START_TIMES[o.scene]:g} s on")
    cut = f"; {o.capped} steps not converged: at least" if o.capped else ""
    run.record(f"hot.fig15.{o.scene}.{o.method}.total", o.total, comparator="info", scale=scale,
               note=f"CPU time over HOT's; {o.cpu:.3f} s, {o.iterations:.1f} iterations, "
               f"{o.inner:.0f} of CG per step; worst step {o.worst:.2f}{cut}")


def record_ranges(run, table):
    """Record the smallest and largest total speed-up over each method of the ablation: under the
    printed ids only where all scenes were run.
    """
    few = "" if set(table) == set(PRINTED) else ".partial"
    for method in ABLATION:
        totals = {name: row[method].total for name, row in table.items()}
        least, most = min(totals, key=totals.get), max(totals, key=totals.get)
        name = "hot.sec7_2.speedup." + method.replace("-", "_")
        run.record(f"{name}.min{few}", smallest(totals), scale=size_text(table),
                   note="the text excepts Sauce and the soft ArmaCat, so does this; of all it is "
                   f"{totals[least]:.2f} ({least})")
        run.record(f"{name}.max{few}", totals[most], scale=size_text(table), note=most)
    run.record("hot.fig15.fastest", fastest(table), comparator="info", scale=size_text(table),
               note=f"scenes, of {len(table)}, where HOT is faster than all methods of section "
               "7.2; the text: all but two")


def smallest(totals):
    """Return the smallest of {scene: total}, of those that the text does not except."""
    return min(total for name, total in totals.items() if name not in EASY)


def fastest(table):
    """Return the number of scenes where HOT is faster than all methods of the ablation."""
    return sum(all(row[m].total > 1.0 for m in ABLATION) for row in table.values())


def record_claims(run, table):
    """Record the claims of the text on single scenes."""
    gmg = {name: table[name]["lbfgs-gmg"].total for name in SLOW_GMG}
    run.record("hot.sec7_3.lbfgs_gmg_soft", min(gmg.values()), scale=size_text(table),
               note=", ".join(f"{name} {total:.2f}" for name, total in gmg.items()))
    if "twist" in table:
        record_twist(run, [table["twist"][method] for method in (*ABLATION, "gast15")])


def record_twist(run, others):
    """Record Figure 1: over all other codes the least total gain, and the largest in a step.

    Where a step of the slowest was cut short, the largest is a bound from below.
    """
    least, most = min(others, key=lambda o: o.total), max(others, key=lambda o: o.worst)
    scale = f"{most.particles} particles, {most.nodes} nodes; {most.steps} steps of Twist"
    run.record("hot.fig1.speedup_total", least.total, scale=scale, note=f"over {least.method}, the "
               "quickest; " + ", ".join(f"{o.method} {o.total:.2f}" for o in others))
    run.record("hot.fig1.speedup_frame", most.worst, scale=scale,
               note=f"over {most.method}, {most.capped} of {most.steps} steps cut short; "
               + ", ".join(f"{o.method} {o.worst:.2f}" for o in others))


def record_stiff(run):
    """Record Gast15 over HOT in the bar of Figure 20 with a stiff middle."""
    count = 3
    dx = run.choose(quick=0.03, standard=0.02, paper=0.0075)
    step = step_after(bar(dx, STIFF, "hot", count), count)
    gast, hot = (solve_step(step, method, **options(method, {"max_iterations": 200})).report
                 for method in ("gast15", "hot"))
    run.record("hot.fig15.bar.gast15", sum(gast.seconds.values()) / sum(hot.seconds.values()),
               comparator=">=", bound=GOAL,
               scale=f"{step.particles} particles, middle {STIFF:.0e} Pa",
               note=f"CPU time of Gast15 over HOT's; {gast.iterations} and {hot.iterations} "
               f"iterations, {gast.cg_iterations} of CG; Gast15: {gast.message}. No printed "
               "number: the goal is what a prototype gained with more particles")


def size_text(table):
    """Return the number of scenes and their sizes as text."""
    sizes = [row["hot"].particles for row in table.values()]
    return f"{len(table)} of {len(PRINTED)} scenes, {min(sizes)} to {max(sizes)} particles"


@experiment("hot.fig11", title="Faceless: time of each step by HOT and by projected Newton",
            profiles=("quick", "standard", "paper"),
            budget={"quick": 6, "standard": 300, "paper": 3600})
def faceless(run):
    """Record consecutive steps of one scene by three methods, from the same states."""
    since, count = run.choose(quick=(START_TIMES["faceless"], 10), standard=(0.0, PULLED),
                              paper=(0.0, PULLED))
    problem, state = warm_state("faceless", run.profile, since)
    rows = []
    for k, step in run.progress(enumerate(following_steps(problem, state, count)), "steps"):
        if k == 0:
            warm_up(step, FACELESS)
        rows += costs(step, ("faceless", k, state.t), FACELESS, {})
    size = particle_count(problem.bodies)
    scale = f"{size} particles (the paper: 110 000), {count} steps from {since:g} s"
    overviews = [overview(rows, method, size, 0) for method in FACELESS[1:]]
    totals = ", ".join(f"{o.method} {o.total:.2f}, worst step {o.worst:.2f}" for o in overviews)
    run.record("hot.sec7_2.faceless.avg_speedup", min(o.total for o in overviews), scale=scale,
               note=f"the smaller one over both: {totals}")
    run.record("hot.sec7_2.faceless.max_frame_speedup", max(o.worst for o in overviews),
               scale=scale, note=f"the larger one over both: {totals}")
    ahead = sum(min(rows[k + 1].cpu, rows[k + 2].cpu) > rows[k].cpu for k in range(0, len(rows), 3))
    run.record("hot.fig11.ahead", ahead / count, comparator="info", scale=scale,
               note="share of the steps in which HOT is the fastest; the text: almost every frame")
    run.table("steps", MethodCost._fields, rows)
