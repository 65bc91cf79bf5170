"""Table 3 over entire runs: the work of projected Newton depends on where in its motion a scene is.

`table3` measures five steps of each scene once its contact or pull has begun. Here each scene runs
by HOT to its end, and the steps that are measured lie evenly over the run, as the paper's means do.
With fewer particles than the paper's they are no reproduction. Few scenes have the printed size.
"""

from functools import partial

import numpy as np

from mpm_ref.scene import build
from mpm_ref.simulate import ended, simulate

from ..common.registry import experiment
from .one_step import implicit_step, solve_step
from .real_bodies import bodies_text, with_real_bodies
from .run_history import unpublished
from .run_states import RunStates, even_times
from .sizes import AFFORDABLE
from .table3 import METHODS, RowCost, cost
from .warm_states import PRINTED, catalogue_name, next_step_length, scene, take_step

COLUMNS = ("scene", "t", "dt", "particles", "preconditioner", "newton", "cg", "converged")


def steps_evenly(problem, states):
    """Yield (state, `ImplicitStep`) of the steps of a run from its `RunStates`: from those on disk,
    else from the run by the problem's method, which writes them.

    Each is valid until the next is asked for. There are fewer where a step leads to the end.
    """
    state, stepper = next(simulate(problem)).state, problem.stepper()
    for k in range(len(states.times)):
        stored = states.read(k, problem)
        if stored is None:
            if k > 0:
                take_step(problem, stepper, state)
            if not march_to(problem, stepper, state, partial(states.is_due, k)):
                return
            states.write(k, state, problem)
        else:
            state = stored
        yield state, implicit_step(stepper, state, next_step_length(problem, stepper, state))


def march_to(problem, stepper, state, is_due):
    """Advance a state until it is due; return whether it is before the run ends."""
    while not is_due(state) and not ended(problem.clock, state):
        take_step(problem, stepper, state)
    return not ended(problem.clock, state)


def run_steps(name, size, folder, count):
    """Return the `steps_evenly` of a scene at a size, whose states are in a folder; at the printed
    size with the bodies of HOT's release where the user has their meshes.
    """
    record, folder = scene(name, size), unpublished(folder)
    if size == "paper":
        record = with_real_bodies(catalogue_name(name), record, folder)
    problem = build(record)
    states = RunStates(folder, name.removesuffix("_stiff"), even_times(problem, count))
    return steps_evenly(problem, states)


def note_bodies(run, name):
    """Note which bodies a scene has at the printed size."""
    if run.profile == "paper":
        run.note(f"{name}: {bodies_text(catalogue_name(name))}")


def measure(name, size, folder, count):
    """Return ({preconditioner: values of a `RowCost`}, rows of COLUMNS) of `run_steps`."""
    advanced, rows, by_method = 0.0, [], {short: [] for short in METHODS}
    for state, step in run_steps(name, size, folder, count):
        advanced, particles = advanced + step.dt, step.particles
        for short, method in METHODS.items():
            report = solve_step(step, method).report
            by_method[short].append(report)
            rows.append((name, state.t, step.dt, particles, short, report.iterations,
                         report.cg_iterations, report.converged))
    return {short: [*cost((name, short, particles), reports, advanced)]
            for short, reports in by_method.items()}, rows


@experiment("hot.table3-runs", title="Newton's CG iterations over entire runs",
            profiles=("quick", "standard", "paper"),
            budget={"quick": 12, "standard": 4000, "paper": 1200})
def table3_runs(run):
    """Record mean CG iterations of a step by both preconditioners, and those of each step."""
    names, count = run.choose(quick=(("faceless",), 2), standard=(PRINTED, 10),
                              paper=(AFFORDABLE, 10))
    smaller = () if run.profile == "paper" else ("small",)
    table = []
    for name in run.progress(names, "scenes"):
        note_bodies(run, name)
        costs, rows = run.cached(name, partial(measure, name, run.profile, run.folder / "states",
                                               count))
        table += rows
        for short, mean in ((short, RowCost(*values)) for short, values in costs.items()):
            few, most = np.quantile([row[6] for row in rows if row[4] == short], (0.0, 1.0))
            run.record(".".join((f"hot.table3.{name}.{short}.cg_iters", *smaller)), mean.cg,
                       scale=f"up to {mean.particles} particles, {mean.steps} steps evenly over "
                       "the run",
                       note=f"{few:.0f} to {most:.0f} by step; {mean.newton:.1f} Newton steps"
                       + ("" if mean.converged else "; not every step converged"))
    run.table("steps", COLUMNS, table)
