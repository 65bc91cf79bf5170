"""Errors of methods on NCLaw's tasks against one true run of each, as rows and as records."""

from functools import partial
from typing import NamedTuple

import numpy as np

from mpm_ref.nclaw.gnn.simulator import Simulator

from ..common.scenes import with_
from .environments import ENVIRONMENTS
from .evaluate import ComparedError, body_maker, compare
from .printed_ids import error_id, is_printed, overall_id, run_variants
from .rivals import RIVALS, PositionRival
from .simulators import GraphNet
from .stand_in_bodies import body_label, has_mesh
from .tasks import TOYS, scenes
from .trained_laws import nets

OURS = "ours"
# methods that are in task (c) at standard: no seeds, no ablations
LARGE = (OURS, "ours-init", "velocity", "admissible", "spline", "neural", "labeled", "sys-id",
         *RIVALS)
INFO = {"comparator": "info"}
COLUMNS = ("method", "environment", "task", "draw", "error", "step", "why")
SHORT = 100         # steps, quick


class ErrorRow(NamedTuple):
    """An error: its method, environment and task; draw of a velocity; see `ComparedError`."""

    method: str
    environment: str
    task: str
    draw: int
    error: float        # [m^2]
    step: int
    why: str


def errors(run, laws, tasks, goes_on=False):
    """Return the `ErrorRow`s of {method: {environment: laws}} on some tasks; goes_on as in
    `compare`.
    """
    rows = []
    for name in run.progress(ENVIRONMENTS, "environments"):
        methods = {method: by_name[name] for method, by_name in laws.items() if name in by_name}
        for task in tasks:
            runnable = {method: one for method, one in methods.items()
                        if can_run(one, task) and is_compared(run, method, task)}
            for draw, scene in enumerate(scenes_of(run, task, name) if runnable else ()):
                makers = [*map(run_of_laws, runnable.values())]
                compared = run.cached(f"{task}.{name}.{draw}",
                                      partial(compare, scene, makers, goes_on))
                rows += [ErrorRow(method, name, task, draw, *ComparedError(*one))
                         for method, one in zip(runnable, compared, strict=True)]
    return rows


def scenes_of(run, task, name):
    """Return the scenes of a task at a run's profile; at quick the start of the first."""
    if run.profile == "quick":
        return [with_(scenes(task, name)[0], steps=SHORT)]
    return scenes(task, name)


def run_of_laws(laws):
    """Return the argument of `compare` for trained laws, a trained graph network or a rival."""
    return laws if isinstance(laws, Simulator | PositionRival) else body_maker(laws)


def can_run(laws, task):
    """Return whether trained laws can run a task: the bodies of task (c) have tens of millions of
    edges within the radius of a graph network, which is that of cubes of 1000 points.
    """
    return task != "geometry" or not isinstance(laws, Simulator)


def is_compared(run, method, task):
    """Return whether a method is run in a task: other seeds and ablations are not in task (c),
    whose bodies stand for others and take minutes a run, unless at the paper's profile.
    """
    return task != "geometry" or run.profile == "paper" or method in LARGE


def record(run, table, rows, tasks=()):
    """Record the errors of a table, and over its environments mean and sample standard deviation
    (NCLAW-overall): of Table 2 over 20 runs, since each velocity counts.
    """
    for method in dict.fromkeys(row.method for row in rows):
        mine = [row for row in rows if row.method == method]
        for (name, task), group in grouped(mine).items():
            words = run_variants(run.profile == "quick", name, task) if is_printed(method) else ()
            record_mean(run, error_id(table, method, name, task, words), group,
                        nets().get(f"{name}-{method}"), **own_rule(method))
        if {row.environment for row in mine} == set(ENVIRONMENTS):
            overall(run, table, method, mine, tasks)


def own_rule(method):
    """Return the rule of a method's errors: none of a method in the papers' tables, whose rule
    stands with the printed number.
    """
    return {} if is_printed(method) else INFO


def record_mean(run, target, rows, net, **rule):
    """Record the mean error of a method, whose net is given, over its runs of one task."""
    name, task = rows[0].environment, rows[0].task
    run.record(target, np.mean([row.error for row in rows]), unit="m^2",
               scale=scale(run, name, task), note=runs_note(rows, net), **rule)


def overall(run, table, method, rows, asked):
    """Record mean and sample standard deviation of errors; as partial where a task that was asked
    for is missing, or where runs are cut short.
    """
    values, tasks = [row.error for row in rows], dict.fromkeys(row.task for row in rows)
    partial_ = run.profile == "quick" or not {*asked} <= {*tasks}
    words = ("partial",) * (partial_ and is_printed(method))
    scale = f"{len(values)} runs: {', '.join(tasks)}{quick_note(run)}"
    deviation = np.std(values, ddof=1) if np.isfinite(values).all() else np.inf
    for name, value in (("mean", np.mean(values)), ("std", deviation)):
        run.record(overall_id(table, method, name, words), value, unit="m^2", scale=scale,
                   note=bodies_note(tasks), **own_rule(method))


def bodies_note(tasks):
    """Return the note on those bodies of task (c) that are stand-ins, where runs of it are among
    all; empty if none is.
    """
    others = [toy.name for toy in TOYS.values() if not has_mesh(toy.name)]
    return (f"{', '.join(others)} of task (c) are stand-ins" if others and "geometry" in tasks
            else "")


def grouped(rows):
    """Return {(environment, task): rows}."""
    groups = {}
    for row in rows:
        groups.setdefault((row.environment, row.task), []).append(row)
    return groups


def broken(rows):
    """Return the sentence on the runs that broke down; empty if none did."""
    return "; ".join(f"run {row.draw} broke down in step {row.step}{corner_note(row)}: {row.why}"
                     for row in rows if row.why)


def runs_note(rows, net):
    """Return the note on runs: those that broke down, and the size of a graph network."""
    return "; ".join(filter(None, (broken(rows), net.description if isinstance(net, GraphNet)
                                   else "")))


def corner_note(row):
    """Return the note on the error of a run that broke down."""
    return ", from where all points count as in the upper corner" if np.isfinite(row.error) else ""


def scale(run, name, task):
    """Describe the size of a task's runs in words."""
    points, body = 1000, "a cube"
    if task == "geometry":
        points, body = TOYS[name].points, body_label(TOYS[name].name)
    runs = "; mean of 3 velocities" if task == "velocity" else ""
    return f"{points} particles, {body}, {scenes(task, name)[0].steps} steps{runs}{quick_note(run)}"


def quick_note(run):
    """Return the note on the steps that a quick run leaves out."""
    return f"; only the first {SHORT} steps" if run.profile == "quick" else ""
