"""Errors of methods on NCLaw's tasks: beside one true run of each, as rows, and as records."""

from functools import partial
from typing import NamedTuple

import numpy as np

from mpm_ref.nclaw.gnn.simulator import Simulator

from ..common import targets
from ..common.scenes import with_
from .environments import ENVIRONMENTS
from .evaluate import ComparedError, body_maker, compare
from .simulators import GraphNet
from .stand_in_bodies import has_mesh, said
from .tasks import TOYS, scenes
from .trained_laws import nets

PRINTED = {"jelly": "jello", "sand": "sand", "plasticine": "plasticine", "water": "water"}
OURS = "ours"
METHODS = ("spline", "neural", "gnn", "ours-init", "ours", "labeled", "sys-id")     # printed ones
REPAIRED, RELEASED = ("spline", "neural"), "-released"      # the printed numbers are of the latter
# methods that are in task (c) at standard: no seeds, no ablations
LARGE = (OURS, "ours-init", "velocity", "admissible", "spline", "neural", "labeled", "sys-id")
INFO = {"comparator": "info"}
COLUMNS = ("method", "environment", "task", "draw", "error", "step", "why")
DIGITS = 2          # of a printed error
SHORT = 100         # steps, quick


class Row(NamedTuple):
    """An error: its method, environment and task; draw of a velocity; see `ComparedError`."""

    method: str
    environment: str
    task: str
    draw: int
    error: float        # [m^2]
    step: int
    why: str


def errors(run, laws, tasks, goes_on=False):
    """[`Row`] of {method: {environment: laws}} on some tasks; goes_on as in `compare`."""
    rows = []
    for name in run.progress(ENVIRONMENTS, "environments"):
        beside = {method: own[name] for method, own in laws.items() if name in own}
        for task in tasks:
            able = {method: one for method, one in beside.items()
                    if fits(one, task) and worth(run, method, task)}
            for draw, scene in enumerate(scenes(task, name) if able else ()):
                if run.profile == "quick":
                    scene = with_(scene, steps=SHORT)
                found = run.cached(f"{task}.{name}.{draw}",
                                 partial(compare, scene, [*map(ready, able.values())], goes_on))
                rows += [Row(method, name, task, draw, *ComparedError(*one))
                         for method, one in zip(able, found, strict=True)]
    return rows


def ready(laws):
    """What `compare` runs, of trained laws or a trained graph network."""
    return laws if isinstance(laws, Simulator) else body_maker(laws)


def fits(laws, task):
    """Whether trained laws can run a task: the bodies of task (c) have tens of millions of edges
    within the radius of a graph network, which is that of cubes of 1000 points.
    """
    return task != "geometry" or not isinstance(laws, Simulator)


def worth(run, method, task):
    """Whether a method is run in a task: other seeds and ablations are not in task (c), whose
    bodies stand for others and take minutes a run, unless at the paper's profile.
    """
    return task != "geometry" or run.profile == "paper" or method in LARGE


def record(run, table, rows, rule, tasks=()):
    """Record the errors of a table by a rule, and over its environments mean and sample standard
    deviation (NCLAW-overall): of Table 2 over 20 runs, since each velocity counts.
    """
    for method in dict.fromkeys(row.method for row in rows):
        mine = [row for row in rows if row.method == method]
        for (name, task), some in grouped(mine).items():
            target = f"{table}.{method}.{PRINTED[name]}"
            target += "" if task == "reconstruction" else f".{task}"
            record_mean(run, target, some, nets().get(f"{name}-{method}"), **rule(target))
        if {row.environment for row in mine} == set(ENVIRONMENTS):
            overall(run, f"{table}.{method}", mine, tasks)


def record_mean(run, target, rows, net, **rule):
    """Record the mean error of a method, whose net is given, over its runs of one task; by the
    paper's rule or another one, but not judged where the runs are not the paper's.
    """
    name, task = rows[0].environment, rows[0].task
    run.record(target, np.mean([row.error for row in rows]), unit="m^2",
               scale=scale(run, name, task), note=noted(rows, net),
               **(INFO if other(run, name, task) else rule))


def overall(run, target, rows, asked):
    """Record mean and sample standard deviation of errors; not judged where a task that was asked
    for is missing.
    """
    found, tasks = [row.error for row in rows], dict.fromkeys(row.task for row in rows)
    strange = not {*asked} <= {*tasks} or any(other(run, row.environment, row.task) for row in rows)
    words = f"{len(found)} runs: {', '.join(tasks)}{short(run)}"
    spread = np.std(found, ddof=1) if np.isfinite(found).all() else np.inf
    for name, value in (("mean", np.mean(found)), ("std", spread)):
        run.record(f"{target}.overall_{name}", value, unit="m^2", scale=words,
                   **(INFO if strange else as_printed(target)))


def grouped(rows):
    """{(environment, task): rows}."""
    found = {}
    for row in rows:
        found.setdefault((row.environment, row.task), []).append(row)
    return found


def broken(rows):
    """The sentence on the runs that broke down; none if none did."""
    return "; ".join(f"run {row.draw} broke down in step {row.step}{counted(row)}: {row.why}"
                     for row in rows if row.why)


def noted(rows, net):
    """What is to be said of runs: those that broke down, and the size of a graph network."""
    return "; ".join(filter(None, (broken(rows), net.said if isinstance(net, GraphNet) else "")))


def counted(row):
    """What counts of a run that broke down, in words."""
    return ", from where all points count as in the upper corner" if np.isfinite(row.error) else ""


def as_printed(target):
    """The rule of a record: the paper's, of a method that is in its tables; of one that is repaired
    here, for its released reading.
    """
    paper, table, method, *rest = target.split(".")
    if method.endswith(RELEASED):
        as_it_was = ".".join((paper, table, method.removesuffix(RELEASED), *rest))
        printed = targets.load().get(as_it_was)
        return {"paper": printed.value, "comparator": printed.comparator} if printed else INFO
    return {} if method in METHODS and method not in REPAIRED else INFO


def to_the_digits(target):
    """The rule of a record that must be the printed number as far as that goes."""
    return {"comparator": "band", "bound": rounded_to(targets.load()[target].value)}


def rounded_to(value):
    """The interval that is rounded to a number of `DIGITS` digits."""
    half = 0.5 * 10.0 ** (np.floor(np.log10(value)) + 1 - DIGITS)
    return float(value - half), float(value + half)


def other(run, name, task):
    """Whether runs are not the paper's: cut short, or of a body that stands for another."""
    return run.profile == "quick" or (task == "geometry" and not has_mesh(TOYS[name].name))


def scale(run, name, task):
    """The size of a task's runs in words."""
    points, body = 1000, "a cube"
    if task == "geometry":
        points, body = TOYS[name].points, said(TOYS[name].name)
    runs = "; mean of 3 velocities" if task == "velocity" else ""
    return f"{points} particles, {body}, {scenes(task, name)[0].steps} steps{runs}{short(run)}"


def short(run):
    """What a quick run leaves out, in words."""
    return f"; only the first {SHORT} steps" if run.profile == "quick" else ""
