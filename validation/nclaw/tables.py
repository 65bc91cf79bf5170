"""Errors of NCLaw's laws: on the run they are trained on (Table 1), and away from it (Table 2)."""

from functools import partial
from typing import NamedTuple

import numpy as np

from mpm_ref.nclaw.gnn.simulator import Simulator

from .. import targets
from ..registry import experiment
from ..verification.scenes import with_
from .environments import ENVIRONMENTS
from .evaluate import Found, compare, learned
from .nets import Untrained, nets, trained
from .simulators import GraphNet
from .tasks import TOYS, scenes
from .toys import has_mesh, said
from .untrained import untrained

PRINTED = {"jelly": "jello", "sand": "sand", "plasticine": "plasticine", "water": "water"}
METHODS = ("spline", "neural", "gnn", "ours-init", "ours", "labeled", "sys-id")     # printed ones
OURS, INIT = "ours", "ours-init"
INFO = {"comparator": "info"}
COLUMNS = ("method", "environment", "task", "draw", "error", "step", "why")
DIGITS = 2          # of a printed error
SHORT = 100         # steps, quick


class Row(NamedTuple):
    """An error: its method, environment and task; draw of a velocity; see `Found`."""

    method: str
    environment: str
    task: str
    draw: int
    error: float        # [m^2]
    step: int
    why: str


@experiment("nclaw.init", title="NCLaw: laws before training",
            profiles=("quick", "standard"), budget={"quick": 20, "standard": 200})
def init(run):
    """Tables 1 and 2, "ours-init": next to no stress, which checks tasks, true runs and measure to
    the printed digits; without task (c), whose bodies are others here. Runs of task (a) break down,
    and go on as in the release.
    """
    laws = {INIT: dict.fromkeys(ENVIRONMENTS, untrained())}
    tasks = run.choose(quick=("reconstruction",),
                       standard=("reconstruction", "time", "velocity"))
    rows = errors(run, laws, tasks, goes_on=True)
    first = [row for row in rows if row.task == "reconstruction"]
    record(run, "nclaw.table1", first, to_the_digits)
    if run.profile == "standard":
        record(run, "nclaw.table2", [row for row in rows if row not in first], to_the_digits)
    run.table("errors", COLUMNS, rows)


@experiment("nclaw.table1", title="NCLaw: reconstruction",
            profiles=("quick", "standard"), budget={"quick": 20, "standard": 60})
def table1(run):
    """All methods that are trained, beside one true run of each environment."""
    contest(run, ("reconstruction",))


@experiment("nclaw.table2", title="NCLaw: other times, velocities and bodies",
            profiles=("quick", "standard"), budget={"quick": 20, "standard": 1800})
def table2(run):
    """All methods that are trained, beside one true run of each task."""
    contest(run, run.choose(quick=("velocity",), standard=("time", "velocity", "geometry")))


def contest(run, tasks):
    """Record the errors of all methods, and what is not trained yet."""
    laws, waiting = known()
    rows = errors(run, laws, tasks) if laws else []
    record(run, run.experiment.id, rows, as_printed, tasks)
    run.table("errors", COLUMNS, rows)
    tell(run, waiting)


def known():
    """({method: {environment: laws}}, [which weights are not there yet])."""
    found, waiting = {}, []
    for name, net in nets().items():
        try:
            laws = trained(name)
        except Untrained as fault:
            waiting.append(str(fault))
        else:
            found.setdefault(method_of(name, net), {})[net.environment] = laws
    return found, waiting


def tell(run, waiting):
    """Record how many weights are not there yet, and which."""
    if waiting:
        run.record(f"{run.experiment.id}.untrained", len(waiting), unit="1", comparator="info",
                   scale=f"of {len(nets())} trainings", note="; ".join(waiting))


def method_of(name, net):
    """The method of a net: its name without that of its environment; "ours" where nothing else is
    in it.
    """
    return "-".join(word for word in name.split("-") if word != net.environment) or OURS


def errors(run, laws, tasks, goes_on=False):
    """[`Row`] of {method: {environment: laws}} on some tasks; goes_on as in `compare`."""
    rows = []
    for name in run.progress(ENVIRONMENTS, "environments"):
        beside = {method: own[name] for method, own in laws.items() if name in own}
        for task in tasks:
            able = {method: one for method, one in beside.items() if fits(one, task)}
            for draw, scene in enumerate(scenes(task, name) if able else ()):
                if run.profile == "quick":
                    scene = with_(scene, steps=SHORT)
                found = run.kept(f"{task}.{name}.{draw}",
                                 partial(compare, scene, [*map(ready, able.values())], goes_on))
                rows += [Row(method, name, task, draw, *Found(*one))
                         for method, one in zip(able, found, strict=True)]
    return rows


def ready(laws):
    """What `compare` runs, of trained laws or a trained graph network."""
    return laws if isinstance(laws, Simulator) else learned(laws)


def fits(laws, task):
    """Whether trained laws can run a task: the bodies of task (c) have tens of millions of edges
    within the radius of a graph network, which is that of cubes of 1000 points.
    """
    return task != "geometry" or not isinstance(laws, Simulator)


def record(run, table, rows, rule, tasks=()):
    """Record the errors of a table by a rule, and over its environments mean and sample standard
    deviation (NCLAW-overall): of Table 2 over 20 runs, since each velocity counts.
    """
    for method in dict.fromkeys(row.method for row in rows):
        mine = [row for row in rows if row.method == method]
        for (name, task), some in grouped(mine).items():
            target = f"{table}.{method}.{PRINTED[name]}"
            target += "" if task == "reconstruction" else f".{task}"
            run.record(target, np.mean([row.error for row in some]), unit="m^2",
                       scale=scale(run, name, task),
                       note=noted(some, nets().get(f"{name}-{method}")),
                       **(INFO if other(run, name, task) else rule(target)))
        if {row.environment for row in mine} == set(ENVIRONMENTS):
            overall(run, f"{table}.{method}", mine, tasks)


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
    """The rule of a record: the paper's, of a method that is in its tables."""
    return {} if target.split(".")[2] in METHODS else INFO


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
