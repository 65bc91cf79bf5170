"""Figure 15 over entire runs: the time of every method for steps evenly over each scene's run.

`overview` measures three consecutive steps of each scene once its contact or pull has begun.
"""

from functools import partial

from ..common import targets
from ..common.registry import experiment
from .overview import (
    ABLATION,
    MethodCost,
    Overview,
    costs_of_steps,
    fastest,
    size_text,
    smallest,
)
from .sizes import AFFORDABLE
from .table3_runs import note_bodies, run_steps
from .warm_states import PRINTED

CAPS = {"max_iterations": 15, "max_cg_iterations": 300}        # of Gast15


def run_costs(name, size, folder, count):
    """Return ([`MethodCost`], [`Overview`]) of `count` steps evenly over a scene's run at a size,
    whose states are in a folder.
    """
    steps = (step for _, step in run_steps(name, size, folder, count))
    return costs_of_steps(name, steps, CAPS)


@experiment("hot.fig15-runs", title="Speed-up overview over entire runs",
            profiles=("quick", "standard", "paper"),
            budget={"quick": 15, "standard": 9000, "paper": 3600})
def speedups_over_runs(run):
    """Record the total time of all methods on all scenes over HOT's, and its ranges."""
    names, count = run.choose(quick=(("faceless",), 2), standard=(PRINTED, 10),
                              paper=(AFFORDABLE[:1], 10))
    rows, table = [], {}
    for name in run.progress(names, "scenes"):
        note_bodies(run, name)
        step_costs, totals = run.cached(name, partial(run_costs, name, run.profile,
                                                      run.folder / "states", count))
        overviews = [Overview(*total) for total in totals]
        rows += step_costs
        table[name] = {o.method: o for o in overviews}
        for o in overviews:
            record_total(run, o)
    record_ranges(run, table)
    run.table("steps", MethodCost._fields, rows)
    run.table("speedups", Overview._fields, [o for row in table.values() for o in row.values()])


def record_total(run, o):
    """Record the total time of one method on one scene, and the worst step."""
    cut = f"; {o.capped} steps not converged: at least" if o.capped else ""
    run.record(f"hot.fig15-runs.{o.scene}.{o.method}", o.total, comparator="info",
               scale=f"up to {o.particles} particles; {o.steps} steps evenly over the run",
               note=f"CPU time over HOT's; {o.cpu:.3f} s, {o.iterations:.1f} iterations, "
               f"{o.inner:.0f} of CG per step; worst step {o.worst:.2f}{cut}")


def record_ranges(run, table):
    """Record the smallest and largest total over each method of the ablation, without a verdict:
    scenes are missing, or smaller than printed.
    """
    printed, scale = targets.load(), size_text(table)
    for method in ABLATION:
        totals = {name: row[method].total for name, row in table.items()}
        word = method.replace("-", "_")
        for end, value in (("min", smallest(totals)), ("max", max(totals.values()))):
            run.record(f"hot.fig15-runs.{word}.{end}", value, comparator="info", scale=scale,
                       note=f"printed {printed[f'hot.sec7_2.speedup.{word}.{end}'].value:g}; "
                       + ", ".join(f"{name} {total:.2f}" for name, total in totals.items()))
    run.record("hot.fig15-runs.fastest", fastest(table), comparator="info", scale=scale,
               note=f"scenes, of {len(table)}, where HOT is faster than all methods "
               "of section 7.2; the text: all but two")
