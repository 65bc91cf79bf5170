"""NSF's reduced runs, on trained networks and on fields of modes, beside their simplest rivals (see
`common.rivals`).
"""

import numpy as np

from mpm_ref.core.blas import one_thread
from mpm_ref.rom.study.baselines import interpolation_weights
from mpm_ref.rom.study.full_model import nsf_full_model
from mpm_ref.rom.study.run import FieldRunOptions, nsf_run

from ..common import rivals
from ..common.registry import experiment
from ..common.rivals import PositionSource, TestRivals, TestRun, nbytes
from .errors import ORIGIN
from .networks import fields_of, nets, trained
from .reduced_runs import fit_study
from .studies import ball, bread, cake, jelly, metal, sand, toothpaste

COARSER = (2, 3, 4)         # times the spacing of the reduced run's grid
REPEATS = 3
KINDS = {"drawn": False, "weighted": True}      # of samples, on fields of modes
NETWORKS = "networks"       # with samples drawn
REDUCED = (NETWORKS, *KINDS)
STUDIES = {"jelly": jelly, "sand": sand, "bread": bread, "toothpaste": toothpaste, "metal": metal,
           "cake": cake, "ball": ball}


@experiment("nsf.rivals", title="NSF: reduced runs beside their simplest rivals",
            profiles=("quick", "standard"), budget={"quick": 10, "standard": 1800})
def compare_rivals(run):
    """Compare the reduced runs of all scenes, with the study's samples, with their rivals; at the
    resolution that networks are trained at.
    """
    rows = []
    for name in run.progress(run.choose(quick=("jelly",), standard=tuple(STUDIES)), "scenes"):
        one, model = fit_study(study_of(run, name)), trained(f"{name}-waves")
        factor = rivals.longest_step(one.study.run(one.study.train[0]))
        with one_thread():
            found = rivals.compare(
                {value: rivals_of(one, model, value, factor) for value in one.study.test},
                run.choose(quick=1, standard=REPEATS))
        rivals.record_rivals(run, f"nsf.rivals.{name}", found, REDUCED, one.scale, ORIGIN)
        rows += rivals.rows_of(name, found.errors)
    run.table("runs", rivals.COLUMNS, rows)


def study_of(run, name):
    """Return the `NsfStudy` of a scene at a profile, at quick with one test."""
    if run.profile == "standard":
        return nets()[f"{name}-waves"].study
    quick = STUDIES[name](3)
    return quick._replace(test=quick.test[:1])


def rivals_of(one, model, value, factor):
    """Return the `TestRivals` of a test of a `FittedStudy`; model: of trained networks; factor: of
    the longer step with MLS-MPM.
    """
    test, study, scene = one.tests[value], one.study, one.study.run(value)
    coarse = {times: study._replace(coarser=study.coarser * times).run(value)
              for times in COARSER}
    sources = [network_source(one, model, value), *mode_sources(one, value),
               rivals.full_source("full", rivals.stretched(scene, 1)),
               *rivals.mls_sources(scene, factor), *rivals.coarse_sources(coarse, test.X)]
    weights = interpolation_weights(one.runs.mu, np.array([value]))
    k = int(np.argmin(np.abs(one.runs.mu[:, 0] - value)))
    return TestRivals(TestRun(test.X, test.x[0], test.dt, 1), sources, {
        rivals.NEAREST: one.runs.x[k], rivals.INTERPOLATED: rivals.weighted_sum(weights,
                                                                                one.runs.x)})


def network_source(one, model, value):
    """Return the `PositionSource` of a reduced run on the networks of a `Model`."""
    networks = one._replace(fields=fields_of(model, one.study), xhat=model.xhat)
    size = nbytes((networks.fields.X, model.field))
    return reduced_source(NETWORKS, networks, value, size, weights=None)


def mode_sources(one, value):
    """Yield the `PositionSource`s of reduced runs on modes, with each kind of samples."""
    fields = one.fields_of_run(value)
    size = nbytes((fields.X, fields.U, fields.tau.modes, fields.C.modes))
    for name, weighted in KINDS.items():
        yield reduced_source(name, one, value, size, one.fields if weighted else None)


def reduced_source(name, one, value, size, weights):
    """Return the `PositionSource` of a reduced run on a `FittedStudy`; weights: fields by which
    samples get weights, or None.
    """
    fields, full = one.fields_of_run(value), nsf_full_model(one.study.run(value))
    sets = one.study.chosen(full, one.study.samples, 0, weights)
    plan = nsf_run(full, fields, FieldRunOptions(sets, inversion=one.inversion), one.rest)
    points = np.arange(len(full.X))
    return PositionSource(name, lambda: ((t, latent) for t, latent, *_ in plan.states()),
                          lambda latent: fields.place(points, latent.xhat), size)
