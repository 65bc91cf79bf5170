"""Samples whose velocity is prescribed count more in the projection than others: an option of ours.

The nodes of a patch have a prescribed velocity, and least squares over all samples give the body a
share of it at a time, step by step. With weights that follow the share of a sample's velocity that
is prescribed (`rom.prescribed`), coordinates follow the patch sooner. The largest weight is chosen
on training runs, and judged on test runs: of the poke those of `ldm.table5`.
"""

from typing import NamedTuple

import numpy as np

from mpm_ref.rom.study.errors import PositionErrors
from mpm_ref.rom.study.full_model import ldm_full_model
from mpm_ref.rom.study.run import RunOptions

from ..common.registry import experiment
from .networks import trained
from .references import References, pod, record_errors, references
from .studies import GRAVITY, POKES, TORSION
from .tables import DRAWS, POINTS, TESTED, R

WEIGHTS = (1.0, 4.0, 16.0, 64.0, 256.0, 1024.0)
CHOSEN_ON = 3           # training runs
MORE = 12               # modes, twice as many as the network has coordinates
COLUMNS = ("map", "weight", "points", "runs", "origin", "centroid", "displacement")


class Weighted(NamedTuple):
    """A map whose runs have weights."""

    name: str               # in records
    study: object
    g: object
    rest: np.ndarray        # (r,) latent coordinates at rest
    tested: int | None      # test runs; None: all

    @property
    def draws(self):
        """Number of draws of few samples."""
        return DRAWS.get(self.study.name, 1)


def maps():
    """Return all maps as `Weighted`."""
    poke, r = POKES.name, R[POKES.name]
    networks = (("network", POKES, poke, TESTED), ("gravity", GRAVITY, "gravity-r7", None),
                ("torsion", TORSION, "torsion-0", None))
    return (*(Weighted(name, study, trained(net).field, trained(net).rest, tested)
              for name, study, net, tested in networks),
            Weighted("pod", POKES, pod(poke, r), np.zeros(r), TESTED),
            Weighted(f"pod-{MORE}", POKES, pod(poke, MORE), np.zeros(MORE), TESTED))


def training_references(study, count):
    """Return the `References` of `count` training runs of a study, evenly among them."""
    runs = study.train[::len(study.train) // count][:count]
    cases = tuple(ldm_full_model(study.scene(*study.mu[k])) for k in runs)
    return References(study.name, cases, tuple(study.run(runs).x), len(study.train))


@experiment("ldm.driven-weight", title="LDM: weights of samples whose velocity is prescribed",
            profiles=("standard",), budget={"standard": 1200})
def driven_weights(run):
    """Record errors of training runs by weight, and those of test runs with the best one."""
    rows = []
    for one in run.progress(maps(), "maps"):
        training = training_references(one.study, CHOSEN_ON)
        found = {w: errors_of(run, (one, "training"), training, RunOptions(driven_weight=w))
                 for w in WEIGHTS}
        for w, errors in found.items():
            record_errors(run, f"ldm.driven-weight.{one.name}.training.{w:g}", errors,
                          f"{len(training.X)} particles, {CHOSEN_ON} of {training.total} training "
                          "runs", comparator="info")
            rows.append((one.name, w, len(training.X), "training", *errors))
        rows += tested_rows(run, one, min(found, key=lambda w: found[w].origin))
    run.table("errors", COLUMNS, rows)


def tested_rows(run, one, weight):
    """Record the errors of test runs with a weight, and over those without; return rows of both."""
    rows, tests = [], references(one.study, one.tested)
    judged = ({"comparator": "info"} if weight == 1.0
              else {"comparator": "<=", "bound": 1.0})
    for points in (POINTS, None):
        without, weighted = (errors_of(run, (one, "test"), tests,
                                       RunOptions(points=points, driven_weight=w))
                             for w in (1.0, weight))
        word, draws = points or "all", f"; draws: {one.draws}" if points else ""
        record_errors(run, f"ldm.driven-weight.{one.name}.{word}", weighted, tests.scale,
                      f"weight {weight:g}, chosen on training runs{draws}", comparator="info")
        run.record(f"ldm.driven-weight.{one.name}.{word}.gain", weighted.origin / without.origin,
                   unit="1", **judged, scale=tests.scale,
                   note=f"error with weight {weight:g} over that without, "
                   f"{100.0 * without.origin:.3g} %{draws}")
        rows += [(one.name, w, points or len(tests.X), "test", *errors)
                 for w, errors in {1.0: without, weight: weighted}.items()]
    return rows


def errors_of(run, about, runs, options):
    """Return the `PositionErrors` of `References` on a map, a mean over draws of few samples;
    about: the `Weighted` map, and a word for the runs.
    """
    one, word = about
    key = f"{one.name}.{word}.{options.points}.{options.driven_weight:g}"
    return PositionErrors(*np.mean([
        run.cached(f"{key}.{k}", lambda k=k: [*runs.run_errors(one.g, one.rest, options, 1000 * k)])
        for k in range(one.draws if options.points else 1)], axis=0).tolist())
