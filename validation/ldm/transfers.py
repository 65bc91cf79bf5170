"""Reduced runs of full models with other transfers than LDM's PIC, and of bodies that start moving.

The cylinder under gravity by PIC, APIC and MLS-MPM, and by each without gravity, with a velocity at
the start. POD modes of each full model's training runs are followed by its own transfer, and by
PIC, the only one that LDM is printed with.
"""

from functools import partial
from typing import NamedTuple

import numpy as np

from mpm_ref.rom.fields.pod import modes
from mpm_ref.rom.study.full_model import ldm_full_model
from mpm_ref.rom.study.run import RunOptions
from mpm_ref.scene import Velocity

from ..common.registry import experiment
from ..common.scenes import catalogue_scene, with_
from .references import nearest_state_errors, record_errors, run_errors
from .studies import LdmStudy, draw_tests, fallen

TRANSFERS = ("pic", "apic", "mls")
HALF = 0.5              # of the error by PIC: below, most of that is of the transfer
R = 7                   # latent coordinates (LDM-sec5.1)
RUNS, TESTS = 12, 3     # of each study
COLUMNS = ("start", "transfer", "reduced", "origin", "centroid", "displacement")


class Case(NamedTuple):
    """A study's full models by one transfer, and what the errors of reduced runs need."""

    study: LdmStudy
    g: object               # `Modes` of the training runs
    x: np.ndarray           # (runs, k + 1, n, d) full-order positions of the test runs [m]


def kicked(speed):
    """LDM-sec5.1's cylinder without gravity, all of which starts downwards at a speed [m/s]."""
    scene = catalogue_scene("ldm_gravity", gravity=(0.0, 0.0, 0.0))
    body = with_(scene.body[0], velocity=Velocity(linear=(0.0, 0.0, -float(speed))))
    return with_(scene, body=(body,))


def by_transfer(make, transfer, parameter):
    """Return the scene that make(parameter) gives, with a transfer."""
    scene = make(parameter)
    return with_(scene, scheme=with_(scene.scheme, transfer=transfer))


STARTS = {"gravity": (fallen, (1.0, 10.0)), "kick": (kicked, (0.1, 1.0))}


def case(start, transfer):
    """Return the `Case` of a start of `STARTS` and a transfer."""
    make, ends = STARTS[start]
    study = LdmStudy(start, np.linspace(*ends, RUNS)[:, None], draw_tests(TESTS, RUNS),
                     partial(by_transfer, make, transfer))
    trained = study.run(study.train)
    return Case(study, modes(trained.X, *trained.flat(), R), study.run(study.test).x)


def reduced_errors(one, transfer):
    """Return the `PositionErrors` of a `Case` by reduced runs with a transfer, all points."""
    study, (make, _) = one.study, STARTS[one.study.name]
    full = [ldm_full_model(by_transfer(make, transfer, *study.mu[k])) for k in study.test]
    return run_errors(full, one.x, one.g, RunOptions(), np.zeros(R))


@experiment("ldm.transfers", title="LDM: reduced runs by other transfers, and of moving starts",
            profiles=("quick", "standard"), budget={"quick": 6, "standard": 60})
def transfers(run):
    """Record errors of POD by the full model's own transfer, and by PIC."""
    rows = []
    starts, chosen = run.choose(quick=(("gravity",), ("apic", "mls")), standard=(STARTS, TRANSFERS))
    for start in run.progress(starts, "starts"):
        for transfer in chosen:
            rows += record_case(run, start, transfer)
    run.table("errors", COLUMNS, rows)


def record_case(run, start, transfer):
    """Record the errors of a start and a transfer; return rows of `COLUMNS`."""
    one, id = case(start, transfer), f"ldm.transfers.{start}.{transfer}"
    X = ldm_full_model(one.study.scene(*one.study.mu[0])).X
    scale = (f"{len(X)} particles, {one.x.shape[1] - 1} steps, {TESTS} test runs, POD of "
             f"{RUNS - TESTS} runs, r = {R}")
    errors = {"own": reduced_errors(one, transfer),
              "nearest": nearest_state_errors(X, one.x, one.g, np.zeros(R))}
    if transfer != "pic":
        errors["pic"] = reduced_errors(one, "pic")
        run.record(f"{id}.gain", errors["own"].origin / errors["pic"].origin, unit="1",
                   comparator="<=", bound=HALF, scale=scale,
                   note="error by the full model's own transfer over that by PIC")
    for word, error in errors.items():
        record_errors(run, f"{id}.{word}", error, scale, comparator="info")
    return [(start, transfer, word, *error) for word, error in errors.items()]
