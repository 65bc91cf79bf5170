"""Maps that need no training by gradients, and samples that are chosen; neither is in the paper.

A curved map is POD with further modes that follow from the first
(`rom.fields.polynomial_manifold`): one linear solve after the singular value decomposition. It is
compared with POD and the trained network of the same latent dimension, on the same test runs. It
needs nonlinear projection: over a step, linear projection leaves the curve by dt^2 / 2 g''(vhat,
vhat).
"""

import numpy as np

from mpm_ref.rom.study.run import PROJECTIONS, RunOptions

from ..common.position_errors import mean_errors
from ..common.registry import experiment
from .networks import trained
from .references import curved_map, record_errors, references
from .studies import GRAVITY, POKES, TORSION

DEGREES = (1, 2, 3)
LAM_F = 1.0 / 30.0          # [m^2], as in the loss (LDM-eq24, in the units of the training code)
DRIVEN = (40, 3.3)          # time levels until a poke has let go, and what each weighs: those that
                            # are driven and those that are free weigh the same in sum
DRAWS = 3
POKED = 2           # of 24 test runs
CHOICES = ("redrawn", "kept", "pivoted")
COLUMNS = ("study", "r", "map", "projection", "points", "samples", "draw", "nearest", "origin",
           "centroid", "displacement")


@experiment("ldm.curved", title="LDM: POD with modes that follow, beside POD and the network",
            profiles=("quick", "standard"), budget={"quick": 10, "standard": 400})
def maps(run):
    """Errors on gravity and torsion by latent dimension, degree and projection, all points."""
    rows = []
    plans = ((GRAVITY, (1, 2, 3, 4, 7), "gravity-r{}"), (TORSION, (7,), "torsion-0"))
    quick = ((GRAVITY, (4,), "gravity-r{}"),)
    for study, dimensions, net in run.choose(quick=quick, standard=plans):
        tests = references(study, run.choose(quick=1, standard=None))
        for r in run.progress(dimensions, study.name):
            model = trained(net.format(r))
            curved = {f"degree-{p}": (curved_map(study.name, r, p), np.zeros(r)) for p in DEGREES}
            for name, mapping in (curved | {"network": (model.field, model.rest)}).items():
                rows += record_projections(run, f"ldm.curved.{study.name}.r{r}.{name}", tests,
                                           mapping)
    run.table("errors", COLUMNS, rows)


@experiment("ldm.curved-poke", title="LDM: what a map of pokes must see",
            profiles=("standard",), budget={"standard": 900})
def of_pokes(run):
    """Errors on pokes, r = 6, all points, by degree, with F in the norm of the modes or without,
    and with the driven states weighing more or not.
    """
    rows, tests = [], references(POKES, POKED)
    for lam_F in (0.0, LAM_F):
        for early in ((0, 1.0), DRIVEN):
            for p in run.progress(DEGREES, f"lam_F {lam_F:.2g}, weight {early[1]}"):
                name = f"degree-{p}{'-F' if lam_F else ''}{'-driven' if early[0] else ''}"
                mapping = curved_map(POKES.name, 6, p, lam_F, early), np.zeros(6)
                rows += record_projections(run, f"ldm.curved-poke.{name}", tests, mapping)
    model = trained("poke")
    rows += record_projections(run, "ldm.curved-poke.network", tests, (model.field, model.rest))
    run.table("errors", COLUMNS, rows)


@experiment("ldm.samples", title="LDM: samples redrawn, kept, or chosen",
            profiles=("quick", "standard"), budget={"quick": 10, "standard": 400})
def choices(run):
    """Errors on gravity, r = 4, linear projection, by number and choice of samples."""
    tests, rows, model = references(GRAVITY, run.choose(quick=1, standard=None)), [], trained(
        "gravity-r4")
    network, modes = (model.field, model.rest), (curved_map(GRAVITY.name, 4, 1), np.zeros(4))
    for name, mapping in run.choose(quick={"network": network},
                                    standard={"network": network, "pod": modes}).items():
        for count in run.progress(run.choose(quick=(10,), standard=(5, 10, 25, 50)), name):
            for choice in CHOICES:
                options = RunOptions(points=count, samples=choice)
                errors = [tests.run_errors(*mapping, options, 1000 * k)
                          for k in range(run.choose(quick=1, standard=DRAWS))]
                mean, note = mean_errors(errors, "draws of samples")
                record_errors(run, f"ldm.samples.{name}.{count}.{choice}", mean, tests.scale, note,
                              comparator="info")
                rows += [(tests.study, 4, name, options.projection, count, choice, k, "", *one)
                         for k, one in enumerate(errors)]
    run.table("errors", COLUMNS, rows)


def record_projections(run, name, tests, mapping):
    """Record the errors on a map, mapping = (map, rest), with both projections; return the rows."""
    rows, nearest = [], tests.nearest_errors(*mapping).origin
    for projection in PROJECTIONS:
        options = RunOptions(projection=projection)
        errors = tests.run_errors(*mapping, options)
        record_errors(run, f"{name}.{projection}", errors, tests.scale,
                      f"the nearest states {100.0 * nearest:.3g} %", comparator="info")
        rows.append((tests.study, mapping[0].r, name.rsplit(".", 1)[-1], projection, len(tests.X),
                     "all", 0, nearest, *errors))
    return rows
