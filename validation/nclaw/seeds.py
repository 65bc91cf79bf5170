"""Laws that are trained from other draws of their initial weights: how much of an error is luck.

Trainings differ by their seed alone. The paper prints one number for each task and names no seed.
Each is a file of weights, remade by `python -m validation.training.nclaw NAME`.
"""

from functools import cache

import numpy as np

from ..common import targets
from ..common.registry import experiment
from ..common.weights_needed import load_available
from .environments import ENVIRONMENTS
from .errors import COLUMNS, errors, grouped, scale
from .longer_horizons import ADMISSIBLE, OURS, by_kind, spread_text
from .printed_ids import error_id
from .trained_laws import identity, nets, stored, weights_of

METHODS = (OURS, ADMISSIBLE)
COUNT, WATER_COUNT = 3, 8       # seeds from 0 on; of the paper's laws on water, whose first three
                                # were apart by a factor of four


def seed_nets():
    """Return {name: `LawNet`} of trainings that differ by their seeds."""
    named = {}
    for method in METHODS:
        for environment in ENVIRONMENTS:
            first = weights_of(method, environment)
            named |= {seed_name(first, seed): nets()[first]._replace(seed=seed)
                      for seed in range(count_of(method, environment))}
    return named


def count_of(method, environment):
    """Return the number of seeds of a method on an environment."""
    return WATER_COUNT if (method, environment) == (OURS, "water") else COUNT


def seed_name(first, seed):
    """Return the name of the training of a seed, from that of seed 0."""
    return f"{first}-seed-{seed}" if seed else first


@cache
def seed_laws(name):
    """Return the `LearnedLaws` of a name; raises as `trained_laws.stored`."""
    return stored(name, identity(seed_nets()[name]))


@experiment("nclaw.seeds", title="NCLaw: trainings from other seeds",
            profiles=("quick", "standard"), budget={"quick": 30, "standard": 1500})
def seeds(run):
    """Record the median error over the seeds of each method, and how far seeds are apart."""
    laws = laws_by_seed(load_available(run, seed_nets(), seed_laws))
    tasks = run.choose(quick=("reconstruction",),
                       standard=("reconstruction", "time", "velocity"))
    rows = errors(run, laws, tasks) if laws else []
    for task, group in grouped(rows).items():
        found = by_kind(group)
        for method in found:
            record_task(run, task, method, found[method])
    run.table("errors", COLUMNS, rows)


def laws_by_seed(laws):
    """Return {method with its seed: {environment: laws}} of laws by their names."""
    by_method = {}
    for name, one in laws.items():
        net = seed_nets()[name]
        method = seed_name(net.method, net.seed)
        by_method.setdefault(method, {})[net.environment] = one
    return by_method


def record_task(run, task, method, seed_errors):
    """Record the median of a method's errors over its seeds [m^2] on a task, (environment, task),
    and the largest over the smallest of two or more where no run broke down. The median is judged,
    by the printed error of the paper's laws, where all seeds are trained.
    """
    name, what = task
    table = "nclaw.table1" if what == "reconstruction" else "nclaw.table2"
    printed = targets.load().get(error_id(table, OURS, name, what))
    judged = (run.profile != "quick" and printed is not None
              and len(seed_errors) == count_of(method, name))
    rule = ({"comparator": "<=", "bound": printed.value} if judged else {"comparator": "info"})
    word = "; the bound is the printed error of the paper's laws" if judged else ""
    id, where = f"nclaw.seeds.{method}.{name}.{what}", scale(run, name, what)
    run.record(id, float(np.median(seed_errors)), unit="m^2", **rule, scale=where,
               note=f"median of {spread_text(seed_errors)}{word}")
    if len(seed_errors) > 1 and np.isfinite(seed_errors).all():
        run.record(f"{id}.spread", max(seed_errors) / min(seed_errors), unit="1",
                   comparator="info", scale=where, note="largest error of a seed over the smallest")
