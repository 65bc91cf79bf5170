"""Pokes whose driven samples count more in the projection than others: an option of ours.

The nodes of a patch have a prescribed velocity, and least squares over all samples give the body a
share of it at a time, step by step. With a weight, coordinates follow the patch sooner. The weight
is chosen on training runs, and tested on the test runs of `ldm.table5`.
"""

import numpy as np

from mpm_ref.rom.study.errors import PositionErrors
from mpm_ref.rom.study.full_model import ldm_full_model
from mpm_ref.rom.study.run import RunOptions

from ..common.registry import experiment
from .networks import trained
from .references import References, pod, record_errors, references
from .studies import POKES
from .tables import DRAWS, POINTS, TESTED, R

WEIGHTS = (1.0, 4.0, 9.0, 25.0, 64.0)
CHOSEN_ON = 3           # training runs
COLUMNS = ("map", "weight", "points", "runs", "origin", "centroid", "displacement")


def maps():
    """Return {name: (map, latent coordinates at rest)} of the network and of POD."""
    network, r = trained(POKES.name), R[POKES.name]
    return {"network": (network.field, network.rest), "pod": (pod(POKES.name, r), np.zeros(r))}


def training_references(count):
    """Return the `References` of `count` training runs, evenly among them."""
    runs = POKES.train[::len(POKES.train) // count][:count]
    cases = tuple(ldm_full_model(POKES.scene(*POKES.mu[k])) for k in runs)
    return References(POKES.name, cases, tuple(POKES.run(runs).x), len(POKES.train))


@experiment("ldm.driven-weight", title="LDM: weights of driven samples",
            profiles=("standard",), budget={"standard": 900})
def driven_weights(run):
    """Record errors of training runs by weight, and those of test runs with the best one."""
    training, tests, rows = training_references(CHOSEN_ON), references(POKES, TESTED), []
    for name in run.progress(maps(), "maps"):
        found = {w: errors_of(run, (name, "training"), training, RunOptions(driven_weight=w))
                 for w in WEIGHTS}
        for w, errors in found.items():
            record_errors(run, f"ldm.driven-weight.{name}.training.{w:g}", errors,
                          f"{len(training.X)} particles, {CHOSEN_ON} of {training.total} training "
                          "runs", comparator="info")
            rows.append((name, w, len(training.X), "training", *errors))
        best = min(found, key=lambda w: found[w].origin)
        rows += tested_rows(run, name, tests, best)
    run.table("errors", COLUMNS, rows)


def tested_rows(run, name, tests, weight):
    """Record the errors of test runs with a weight, and over those without; return rows of both."""
    rows = []
    judged = ({"comparator": "info"} if weight == 1.0
              else {"comparator": "<=", "bound": 1.0})
    for points in (POINTS, None):
        without, weighted = (errors_of(run, (name, "test"), tests,
                                       RunOptions(points=points, driven_weight=w))
                             for w in (1.0, weight))
        word, draws = points or "all", f"; {DRAWS[POKES.name]} draws" if points else ""
        record_errors(run, f"ldm.driven-weight.{name}.{word}", weighted, tests.scale,
                      f"weight {weight:g}, chosen on training runs{draws}", comparator="info")
        run.record(f"ldm.driven-weight.{name}.{word}.gain", weighted.origin / without.origin,
                   unit="1", **judged, scale=tests.scale,
                   note=f"error with weight {weight:g} over that without, "
                   f"{100.0 * without.origin:.3g} %{draws}")
        rows += [(name, w, points or len(tests.X), "test", *errors)
                 for w, errors in {1.0: without, weight: weighted}.items()]
    return rows


def errors_of(run, about, runs, options):
    """Return the `PositionErrors` of `References` on a map, a mean over draws of few samples;
    about: its name, and a word for the runs.
    """
    g, rest = maps()[about[0]]
    draws = range(DRAWS[POKES.name] if options.points else 1)
    key = f"{'.'.join(about)}.{options.points}.{options.driven_weight:g}"
    return PositionErrors(*np.mean([
        run.cached(f"{key}.{k}", lambda k=k: [*runs.run_errors(g, rest, options, 1000 * k)])
        for k in draws], axis=0).tolist())
