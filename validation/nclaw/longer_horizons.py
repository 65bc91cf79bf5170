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
from .trained_laws import (
    COMMAND,
    SEEDS,
    file_digest,
    identity,
    nets,
    stored,
    trained,
    weights_of,
)

OURS, LONGER, ADMISSIBLE = "ours", "longer", "admissible"
PARTS = {"epochs": 40, "first": 500, "last": 1500}      # two segments, and one in the later half
HORIZONS = {OURS: {**PARTS, "elastic_rate": 0.02, "plastic_rate": 0.002},
            ADMISSIBLE: {**PARTS, "elastic_rate": 0.01, "plastic_rate": 0.001}}
STARTS = (*ENVIRONMENTS, *(f"water-seed-{seed}" for seed in SEEDS),
          *(weights_of(ADMISSIBLE, name) for name in ENVIRONMENTS))


class Pair(NamedTuple):
    """The laws of a training as printed, and of the one that goes on from it."""

    printed: object     # `LearnedLaws`
    longer: object


def longer_nets():
    """Return {name: `LawNet`} of the trainings with longer horizons."""
    starts = {start: nets()[start] for start in STARTS}
    return {f"{start}-{LONGER}": net._replace(start=start, **HORIZONS[net.method])
            for start, net in starts.items()}


@cache
def longer_laws(name):
    """Return the `LearnedLaws` of a name; raises as `continued_laws`."""
    return continued_laws(name, longer_nets()[name])


def continued_laws(name, net):
    """Return the `LearnedLaws` of a `LawNet` that goes on; raises as `trained_laws.trained`, and
    where they went on from other weights than those that are there.
    """
    laws = stored(name, identity(net))
    start = laws.about.get("start_sha256")      # of trainings since it is noted
    if start is not None and start != file_digest(net.start):
        raise ValueError(f"{name}.npz goes on from other weights than {net.start}.npz: train it "
                         f"again, {COMMAND} {name}")
    return laws


@experiment("nclaw.longer", title="NCLaw: longer horizons after the printed training",
            profiles=("quick", "standard"), budget={"quick": 20, "standard": 1500})
def longer_horizons(run):
    """Record errors of the laws as printed and of those that went on, in the same runs."""
    pairs = available_pairs(run)
    tasks = run.choose(quick=("reconstruction",),
                       standard=("reconstruction", "time", "velocity"))
    laws = laws_by_kind(pairs)
    rows = errors(run, laws, tasks) if laws else []
    for (name, task), group in grouped(rows).items():
        found = by_kind(group)
        for method in HORIZONS:
            if kinds_of(method)[0] in found:
                record_task(run, (name, task), method, found)
    run.table("errors", COLUMNS, rows)


def laws_by_kind(pairs):
    """Return {kind, with the seed: {environment: laws}} of pairs by the names of their starts."""
    laws = {}
    for start, pair in pairs.items():
        net = nets()[start]
        seed = f"-seed-{net.seed}" if net.seed else ""
        for kind, one in zip(kinds_of(net.method), pair, strict=True):
            laws.setdefault(kind + seed, {})[net.environment] = one
    return laws


def kinds_of(method):
    """Return the words for laws of a method as printed, and for those that went on."""
    return (OURS, LONGER) if method == OURS else (method, f"{method} {LONGER}")


def available_pairs(run):
    """Return {start: `Pair` of laws} of the trainings whose weights are there; record others."""
    printed = load_available(run, STARTS, trained)
    longer = load_available(run, longer_nets(), longer_laws)
    return {start: Pair(laws, longer[f"{start}-{LONGER}"]) for start, laws in printed.items()
            if f"{start}-{LONGER}" in longer}


def by_kind(rows):
    """Return {kind: mean errors [m^2], one of each seed} of the rows of a task."""
    found = {}
    for method in dict.fromkeys(row.method for row in rows):
        found.setdefault(method.split("-")[0], []).append(
            float(np.mean([row.error for row in rows if row.method == method])))
    return found


def record_task(run, task, method, seed_errors):
    """Record the medians of a task, (environment, task), over the seeds of a method: the error with
    longer horizons against the printed one, and over that without. seed_errors: as of `by_kind`.
    """
    short, (name, what) = run.profile == "quick", task
    trained_on = what == "reconstruction"
    printed = targets.load().get(error_id(
        "nclaw.table1" if trained_on else "nclaw.table2", OURS, name, what, ()))
    before, after = (seed_errors[kind] for kind in kinds_of(method))
    ours, longer = float(np.median(before)), float(np.median(after))
    rule = ({"comparator": "info"} if printed is None
            else {"comparator": "<=", "bound": printed.value})
    id = ".".join(("nclaw.longer", *((method,) if method != OURS else ()), name, what))
    run.record(id, longer, unit="m^2", **rule, scale=scale(run, name, what),
               note=f"{spread_text(after)}; the bound is the printed error of the paper's laws; "
               f"without longer horizons {spread_text(before)}")
    run.record(f"{id}.ratio", longer / ours, unit="1", scale=scale(run, name, what),
               **({"comparator": "info"} if short or trained_on else
                  {"comparator": "<=", "bound": 1.0}),
               note="error with longer horizons over that without"
               + ("; this error is the loss of the later half of the training" if trained_on
                  else ""))


def spread_text(values):
    """Return errors of seeds as text: each of a few."""
    return counted(len(values), "seed") + ": " + ", ".join(f"{value:.3g}" for value in values)
