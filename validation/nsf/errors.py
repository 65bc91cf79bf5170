"""Errors of reduced runs with inferred stress: jelly cube and sand column (Table 1, Figures 7 and
12, appendix B), with fields of POD modes (`mpm_ref/rom/fields/pod_fields.py`) in place of the
paper's networks.
"""

from functools import partial

import numpy as np

from mpm_ref.rom.study.errors import PositionErrors

from ..common.position_errors import record_position_errors
from ..common.registry import experiment
from .reduced_runs import FASTER, fit_study, refit
from .states import keep_states
from .studies import jelly, sand

ORIGIN = "from the corner of the unit box that scenes stand in"
MODAL = "fields of modes, no networks"
MODES = "modes"         # behind the ids of printed numbers, which are of networks
DRAWS, FEW = 10, 3      # of samples; at the printed resolution
ENDS = (23.0, 36.5)     # angles of friction [degrees] that are tested at quick, and whose states
                        # are kept
COLUMNS = ("fields", "value", "samples", "draw", "faster", "origin", "centroid", "displacement",
           "stress", "points", "kept", "misfit")


@experiment("nsf.jelly", title="NSF: a jelly cube hits a jelly wall",
            profiles=("quick", "standard"), budget={"quick": 20, "standard": 120})
def cube(run):
    """Errors with 50 samples and all particles, with a longer step, and without the affine field;
    those of the nearest states and of the nearest training run.
    """
    one = fit_study(jelly(run.choose(quick=2, standard=1)))
    rows = record_study(run, "nsf.jelly", one, range(run.choose(quick=1, standard=DRAWS)))
    rows += record_without_affine(run, "nsf.jelly", one) + record_map_alone(run, "nsf.jelly", one)
    keep_states(run, one, one.study.test, ("map",))
    run.table("errors", COLUMNS, rows)


@experiment("nsf.sand", title="NSF: a sand column collapses",
            budget={"quick": 30, "standard": 600, "paper": 10000})
def column(run):
    """Errors with 150 samples and all particles, without the affine field, with fewer latent
    coordinates, and where the stress does not depend on the angle; those of the nearest states and
    of the nearest training run.
    """
    study = run.choose(quick=lambda: sand(3, 4)._replace(test=ENDS),
                       standard=partial(sand, 2), paper=sand)
    one = fit_study(study())
    rows = record_study(run, "nsf.sand", one, range(run.choose(quick=1, standard=DRAWS, paper=FEW)))
    rows += record_without_affine(run, "nsf.sand", one)
    fewer = refit(one, one.study.sizes._replace(r=3, smoothing=1e-4), follows=True)
    rows += record_variant(run, "nsf.sand.r3", fewer, "r3",
                           "three latent coordinates, smoothing 1e-4")
    blind = refit(one, one.study.sizes, follows=False)
    rows += record_variant(run, "nsf.sand.blind", blind, "blind",
                           "the stress is not told the angle of friction (NSF-mu-dep)")
    keep_states(run, one, ENDS)
    run.table("errors", COLUMNS, rows)


def record_study(run, name, one, draws):
    """Record the errors of a study; return the rows of all runs."""
    few = error_rows(one, "modal", one.study.samples, draws)
    record_mean(run, f"{name}.error.{MODES}", few, one.scale, f"{one.study.samples} samples")
    record_nearest(run, name, one)
    few += record_weighted(run, f"{name}.error", one, one.study.samples, draws)
    return few + record_all_samples(run, name, one) + record_longer_steps(run, name, one)


def record_all_samples(run, name, one):
    """Record errors with all particles as samples, and of the stress; return their rows."""
    rows = error_rows(one, "modal", len(one.runs.X), (0,))
    record_mean(run, f"{name}.all", rows, one.scale, "all particles are samples", comparator="info")
    run.record(f"{name}.stress", 100.0 * mean(rows, "stress"), unit="%", scale=one.scale,
               comparator="info", note="of the Kirchhoff stress, all particles and times; all "
               "particles are samples")
    return rows


def record_longer_steps(run, name, one):
    """Record the errors with longer steps; return their rows."""
    rows = error_rows(one, "modal", one.study.samples, (0,), FASTER)
    record_mean(run, f"{name}.faster", rows, one.scale, f"steps {FASTER} times as long, "
          f"{one.study.samples} samples", comparator="info")
    return rows


def record_nearest(run, name, one):
    """Record the errors of the nearest states and of the nearest training run, and in how many
    tests that run is the very same, as the grid feels a solid only where it passes a node.
    """
    nearest, nearest_run = ([errors_of(value) for value in one.study.test]
                            for errors_of in (one.nearest_state_errors, one.nearest_run_errors))
    same = sum(errors.origin == 0.0 for errors in nearest_run)
    for word, errors, note in (("nearest", nearest, "nearest states that the fields know"),
                               ("next_run", nearest_run,
                                "the training run whose parameter is nearest, taken as it is; "
                                f"in {same} of {len(nearest_run)} tests it is the very same run")):
        record_errors(run, f"{name}.{word}", PositionErrors(*np.mean(errors, axis=0)), one.scale,
                      note, comparator="info")


def record_without_affine(run, name, one):
    """Record the errors without the affine field C: PIC."""
    without = refit(one, one.study.sizes._replace(C=0), one.study.follows)
    return record_variant(run, f"{name}.no_affine", without, "no-affine", "no affine field")


def record_map_alone(run, name, one):
    """Record the errors of the model of the map alone, which the paper compares with."""
    rows = error_rows(one._replace(map_alone=True), "map-alone", one.study.samples, (0,))
    record_mean(run, f"{name}.baseline_error.{MODES}", rows, one.scale,
                "stress of the map's gradient, no affine field (NSF-X12)")
    return rows


def record_variant(run, name, one, word, note):
    """Record the errors of other fields with the study's samples; return their rows."""
    rows = error_rows(one, word, one.study.samples, (0,))
    record_mean(run, name, rows, one.scale, note, comparator="info")
    return rows


def record_weighted(run, name, one, count, draws):
    """Record the errors with samples weighted by cubature; return their rows."""
    rows = error_rows(one, "cubature", count, draws, weighted=True)
    record_mean(run, f"{name}.{MODES}.weighted", rows, one.scale, f"at most {count} samples with "
                f"weights by cubature, of random candidates; {weights_note(rows)}")
    return rows


def weights_note(rows):
    """Describe samples with weights: their number, and the misfit of their weights."""
    return (f"{mean(rows, 'kept'):.4g} kept, whose weights leave {mean(rows, 'misfit'):.2g} of the "
            "modes' products, on average")


def error_rows(one, word, count, draws, dt_factor=1.0, weighted=False):
    """Return a row of COLUMNS for each test and draw."""
    runs = [(value, draw, one.errors(value, count, draw, dt_factor, weighted))
            for value in one.study.test for draw in draws]
    return [(word, value, count, draw, dt_factor, *errors.errors, *errors[1:5])
            for value, draw, errors in runs]


def mean(rows, column):
    """Return the mean of a column."""
    return float(np.mean([row[COLUMNS.index(column)] for row in rows]))


def record_mean(run, name, rows, scale, note, **rule):
    """Record the mean error of rows in per cent, with the largest; rule: as of `record_errors`."""
    errors = PositionErrors(*(mean(rows, column) for column in PositionErrors._fields))
    worst = 100.0 * max(row[COLUMNS.index("origin")] for row in rows)
    record_errors(run, name, errors, scale,
                  f"{note}; mean of {len(rows)}, the largest {worst:.3g} %", **rule)


def record_errors(run, name, errors, scale, note, fields=MODAL, **rule):
    """Record `PositionErrors` in per cent; fields: their kind, in words."""
    record_position_errors(run, name, errors, scale, f"{note}; {fields}; {ORIGIN}", **rule)
