"""Laws that go on learning with longer horizons, a variant of NCLaw's recipe: from the weights of a
training with 25 to 200 steps between restarts (NCLAW-train) on, with 500, then with all 1000.

A free run may leave the states that short segments show to the laws, all of which begin on the true
run. Horizons, epochs and rates were set on the training error of water. Each is a file of weights,
remade by `python -m validation.training.nclaw NAME`.
"""

from functools import cache
from typing import NamedTuple

import numpy as np

from mpm_ref.store.text import counted

from ..common import targets
from ..common.registry import experiment
from ..common.weights_needed import load_available
from .environments import ENVIRONMENTS
from .errors import COLUMNS, errors, grouped, scale
from .printed_ids import error_id
from .trained_laws import SEEDS, LawNet, identity, stored, trained

OURS, LONGER = "ours", "longer"
HORIZONS = {"epochs": 40, "first": 500, "last": 1500,   # two segments, and one in the later half
            "elastic_rate": 0.02, "plastic_rate": 0.002}
STARTS = (*ENVIRONMENTS, *(f"water-seed-{seed}" for seed in SEEDS))


class Pair(NamedTuple):
    """A training as printed and the one that goes on from it, by their names."""

    printed: str
    longer: str


def longer_nets():
    """Return {name: `LawNet`} of the trainings with longer horizons."""
    return {f"{start}-{LONGER}": LawNet(start.split("-")[0], start=start, seed=seed_of(start),
                                        **HORIZONS) for start in STARTS}


def seed_of(name):
    """Return the seed of a training by its name."""
    return int(name.rpartition("-seed-")[2]) if "-seed-" in name else 0


@cache
def longer_laws(name):
    """Return the `LearnedLaws` of a name; raises as `trained_laws.trained`."""
    return stored(name, identity(longer_nets()[name]))


@experiment("nclaw.longer", title="NCLaw: longer horizons after the printed training",
            profiles=("quick", "standard"), budget={"quick": 20, "standard": 900})
def longer_horizons(run):
    """Record errors of the laws as printed and of those that went on, in the same runs."""
    pairs = available_pairs(run)
    tasks = run.choose(quick=("reconstruction",),
                       standard=("reconstruction", "time", "velocity"))
    laws = {}
    for start, pair in pairs.items():
        name = start.split("-")[0]
        seed = f"-seed-{seed_of(start)}" if seed_of(start) else ""
        laws.setdefault(OURS + seed, {})[name] = pair.printed
        laws.setdefault(LONGER + seed, {})[name] = pair.longer
    rows = errors(run, laws, tasks) if laws else []
    for (name, task), group in grouped(rows).items():
        record_task(run, name, task, by_method(group))
    run.table("errors", COLUMNS, rows)


def available_pairs(run):
    """Return {start: `Pair` of laws} of the trainings whose weights are there; record others."""
    printed = load_available(run, STARTS, trained)
    longer = load_available(run, longer_nets(), longer_laws)
    return {start: Pair(laws, longer[f"{start}-{LONGER}"]) for start, laws in printed.items()
            if f"{start}-{LONGER}" in longer}


def by_method(rows):
    """Return {OURS and LONGER: mean errors [m^2], one of each seed} of the rows of a task."""
    found = {OURS: [], LONGER: []}
    for method in dict.fromkeys(row.method for row in rows):
        found[method.split("-")[0]].append(
            float(np.mean([row.error for row in rows if row.method == method])))
    return found


def record_task(run, name, task, by_kind):
    """Record the medians of a task over the seeds: the error with longer horizons against the
    printed one, and over that without.
    """
    short = run.profile == "quick"
    printed = targets.load().get(error_id(
        "nclaw.table1" if task == "reconstruction" else "nclaw.table2", OURS, name, task, ()))
    before, after = by_kind[OURS], by_kind[LONGER]
    ours, longer = float(np.median(before)), float(np.median(after))
    rule = ({"comparator": "info"} if printed is None
            else {"comparator": "<=", "bound": printed.value})
    run.record(f"nclaw.longer.{name}.{task}", longer, unit="m^2", **rule,
               scale=scale(run, name, task),
               note=f"{spread_text(after)}; the bound is the printed error; without longer "
               f"horizons {spread_text(before)}")
    trained_on = task == "reconstruction"
    run.record(f"nclaw.longer.{name}.{task}.ratio", longer / ours, unit="1",
               scale=scale(run, name, task), **({"comparator": "info"} if short or trained_on else
                                                {"comparator": "<=", "bound": 1.0}),
               note="error with longer horizons over that without"
               + ("; this error is the loss of the later half of the training" if trained_on
                  else ""))


def spread_text(values):
    """Return errors of seeds as text: each of a few."""
    return counted(len(values), "seed") + ": " + ", ".join(f"{value:.3g}" for value in values)
