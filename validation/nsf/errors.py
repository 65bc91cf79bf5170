"""Errors of reduced runs with inferred stress: jelly cube and sand column (Table 1, Figures 7 and
12, appendix B), with fields that are spans of modes (`mpm_ref/rom/spanned.py`) in place of the
paper's networks.
"""

import numpy as np

from mpm_ref.reduced.errors import Errors

from ..registry import experiment
from .studies import jelly, sand
from .tested import refitted, tested

ORIGIN = "from the corner of the unit box that scenes stand in"
MODAL = "fields of modes, no networks"
FASTER = 1.5            # longer steps at deployment
DRAWS = 10              # of samples
COLUMNS = ("fields", "value", "samples", "draw", "faster", "origin", "centroid", "displacement",
           "stress", "points")


@experiment("nsf.jelly", title="NSF: a jelly cube hits a jelly wall",
            profiles=("quick", "standard"), budget={"quick": 20, "standard": 120})
def cube(run):
    """Errors with 50 samples and all particles, with a longer step, and without the affine field;
    beside the nearest states and the nearest training run.
    """
    one = tested(jelly(run.choose(quick=2, standard=1)))
    rows = measured(run, "nsf.jelly", one, range(run.choose(quick=1, standard=DRAWS)))
    run.record("nsf.jelly.samples", one.study.samples, scale=one.scale)
    run.record("nsf.jelly.r", one.study.sizes.r, scale=one.scale)
    if run.profile == "standard":
        run.record("nsf.jelly.particles", len(one.runs.X), scale=one.scale)
    rows += without_affine(run, "nsf.jelly", one)
    run.table("errors", COLUMNS, rows)


@experiment("nsf.sand", title="NSF: a sand column collapses",
            profiles=("quick", "standard"), budget={"quick": 30, "standard": 600})
def column(run):
    """Errors with 150 samples and all particles, without the affine field, with fewer latent
    coordinates, and where the stress is not told the angle; beside the nearest states and the
    nearest training run.
    """
    one = tested(sand(run.choose(quick=3, standard=2), run.choose(quick=4, standard=16)))
    rows = measured(run, "nsf.sand", one, range(run.choose(quick=1, standard=DRAWS)))
    run.record("nsf.sand.samples", one.study.samples, scale=one.scale)
    run.record("nsf.sand.r", one.study.sizes.r, scale=one.scale)
    rows += without_affine(run, "nsf.sand", one)
    fewer = refitted(one, one.study.sizes._replace(r=3, smoothing=1e-4), follows=True)
    rows += beside(run, "nsf.sand.r3", fewer, "r3", "three latent coordinates, smoothing 1e-4")
    blind = refitted(one, one.study.sizes, follows=False)
    rows += beside(run, "nsf.sand.blind", blind, "blind",
                   "the stress is not told the angle of friction (NSF-mu-dep)")
    run.table("errors", COLUMNS, rows)


def measured(run, name, one, draws):
    """Record the errors of a study; rows of all runs."""
    study = one.study
    few = rows_of(one, "modal", study.samples, draws)
    every = rows_of(one, "modal", len(one.runs.X), (0,))
    longer = rows_of(one, "modal", study.samples, (0,), FASTER)
    share(run, f"{name}.error", few, one.scale, f"{study.samples} samples")
    share(run, f"{name}.all", every, one.scale, "all particles are samples", comparator="info")
    share(run, f"{name}.faster", longer, one.scale, f"steps {FASTER} times as long, "
          f"{study.samples} samples", comparator="info")
    for word, found, note in (("nearest", one.nearest, "nearest states that the fields know"),
                              ("next_run", one.next_run, "the training run whose parameter is "
                               "nearest, taken as it is")):
        errors = Errors(*np.mean([found(value) for value in study.test], axis=0))
        said(run, f"{name}.{word}", errors, one.scale, note, comparator="info")
    run.record(f"{name}.stress", 100.0 * mean(few, "stress"), unit="%", scale=one.scale,
               comparator="info", note="of the Kirchhoff stress, all particles and times")
    return few + every + longer


def without_affine(run, name, one):
    """Record the same without the affine field C: PIC."""
    without = refitted(one, one.study.sizes._replace(C=0), one.study.follows)
    return beside(run, f"{name}.no_affine", without, "no-affine", "no affine field")


def beside(run, name, one, word, note):
    """Record errors of other fields with the study's samples; their rows."""
    rows = rows_of(one, word, one.study.samples, (0,))
    share(run, name, rows, one.scale, note, comparator="info")
    return rows


def rows_of(one, word, count, draws, faster=1.0):
    """A row for each test and draw."""
    found = [(value, draw, one.errors(value, count, draw, faster))
             for value in one.study.test for draw in draws]
    return [(word, value, count, draw, faster, *got.errors, got.stress, got.points)
            for value, draw, got in found]


def mean(rows, column):
    """Of a column."""
    return float(np.mean([row[COLUMNS.index(column)] for row in rows]))


def share(run, name, rows, scale, note, **rule):
    """Record the mean error of rows, in per cent, and the largest."""
    errors = Errors(*(mean(rows, column) for column in Errors._fields))
    worst = 100.0 * max(row[COLUMNS.index("origin")] for row in rows)
    said(run, name, errors, scale, f"{note}; mean of {len(rows)}, the largest {worst:.3g} %",
         **rule)


def said(run, name, errors, scale, note, **rule):
    """Record `Errors` in per cent: the paper's, which depends on the origin, and others beside."""
    origin, centroid, displacement = (100.0 * error for error in errors)
    run.record(name, origin, unit="%", scale=scale, note=f"{note}; {MODAL}; {ORIGIN}; from the "
               f"centroid {centroid:.3g} %, of the displacement {displacement:.3g} %", **rule)
