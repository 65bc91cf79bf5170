"""Errors of reduced runs with inferred stress: jelly cube and sand column (Table 1, Figures 7 and
12, appendix B), with fields that are spans of modes (`mpm_ref/rom/fields/pod_fields.py`) in
place of the paper's networks.
"""

import numpy as np

from mpm_ref.rom.study.errors import PositionErrors

from ..common.registry import experiment
from .reduced_runs import FASTER, refitted, tested
from .states import keep_states
from .studies import jelly, sand

ORIGIN = "from the corner of the unit box that scenes stand in"
MODAL = "fields of modes, no networks"
DRAWS, FEW = 10, 3      # of samples; at the printed resolution
COLUMNS = ("fields", "value", "samples", "draw", "faster", "origin", "centroid", "displacement",
           "stress", "points", "kept", "misfit")


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
    rows += without_affine(run, "nsf.jelly", one) + map_alone(run, "nsf.jelly", one)
    keep_states(run, one, one.study.test, ("map",))
    run.table("errors", COLUMNS, rows)


@experiment("nsf.sand", title="NSF: a sand column collapses",
            budget={"quick": 30, "standard": 600, "paper": 10000})
def column(run):
    """Errors with 150 samples and all particles, without the affine field, with fewer latent
    coordinates, and where the stress is not told the angle; beside the nearest states and the
    nearest training run.
    """
    one = tested(sand(run.choose(quick=3, standard=2, paper=1),
                      run.choose(quick=4, standard=16, paper=16)))
    rows = measured(run, "nsf.sand", one, range(run.choose(quick=1, standard=DRAWS, paper=FEW)))
    run.record("nsf.sand.samples", one.study.samples, scale=one.scale)
    run.record("nsf.sand.r", one.study.sizes.r, scale=one.scale)
    rows += without_affine(run, "nsf.sand", one)
    fewer = refitted(one, one.study.sizes._replace(r=3, smoothing=1e-4), follows=True)
    rows += beside(run, "nsf.sand.r3", fewer, "r3", "three latent coordinates, smoothing 1e-4")
    blind = refitted(one, one.study.sizes, follows=False)
    rows += beside(run, "nsf.sand.blind", blind, "blind",
                   "the stress is not told the angle of friction (NSF-mu-dep)")
    keep_states(run, one, one.study.test[::3])
    run.table("errors", COLUMNS, rows)


def measured(run, name, one, draws):
    """Record the errors of a study; rows of all runs."""
    few = rows_of(one, "modal", one.study.samples, draws)
    share(run, f"{name}.error", few, one.scale, f"{one.study.samples} samples")
    known(run, name, one)
    few += by_cubature(run, f"{name}.cubature", one, one.study.samples, draws)
    return few + compared(run, name, one) + longer(run, name, one)


def compared(run, name, one):
    """Record errors where all particles are samples, and of the stress; their rows."""
    rows = rows_of(one, "modal", len(one.runs.X), (0,))
    share(run, f"{name}.all", rows, one.scale, "all particles are samples", comparator="info")
    run.record(f"{name}.stress", 100.0 * mean(rows, "stress"), unit="%", scale=one.scale,
               comparator="info", note="of the Kirchhoff stress, all particles and times; all "
               "particles are samples")
    return rows


def longer(run, name, one):
    """Record the errors with longer steps; their rows."""
    rows = rows_of(one, "modal", one.study.samples, (0,), FASTER)
    share(run, f"{name}.faster", rows, one.scale, f"steps {FASTER} times as long, "
          f"{one.study.samples} samples", comparator="info")
    return rows


def known(run, name, one):
    """Record how far the nearest states and the nearest training run are off, and in how many tests
    that run is the very same, as the grid feels a solid only where it passes a node.
    """
    nearest, next_run = ([found(value) for value in one.study.test]
                         for found in (one.nearest, one.next_run))
    same = sum(errors.origin == 0.0 for errors in next_run)
    for word, found, note in (
            ("nearest", nearest, "nearest states that the fields know"),
            ("next_run", next_run, "the training run whose parameter is nearest, taken as it is; "
             f"in {same} of {len(next_run)} tests it is the very same run")):
        said(run, f"{name}.{word}", PositionErrors(*np.mean(found, axis=0)), one.scale, note,
             comparator="info")


def without_affine(run, name, one):
    """Record the same without the affine field C: PIC."""
    without = refitted(one, one.study.sizes._replace(C=0), one.study.follows)
    return beside(run, f"{name}.no_affine", without, "no-affine", "no affine field")


def map_alone(run, name, one):
    """Record errors of the model that knows the map alone, which the paper compares with."""
    rows = rows_of(one._replace(map_alone=True), "map-alone", one.study.samples, (0,))
    share(run, f"{name}.baseline_error", rows, one.scale, "stress of the map's gradient, no affine "
          "field (NSF-X12)")
    return rows


def beside(run, name, one, word, note):
    """Record errors of other fields with the study's samples; their rows."""
    rows = rows_of(one, word, one.study.samples, (0,))
    share(run, name, rows, one.scale, note, comparator="info")
    return rows


def by_cubature(run, name, one, count, draws):
    """Record errors with samples that have weights by cubature; their rows."""
    rows = rows_of(one, "cubature", count, draws, weighed=True)
    share(run, name, rows, one.scale, f"at most {count} samples with weights by cubature, of "
          f"random candidates; {weights(rows)}", comparator="info")
    return rows


def weights(rows):
    """Of samples with weights: how many there are, and how far off the weights are; in words."""
    return (f"{mean(rows, 'kept'):.4g} kept, whose weights leave {mean(rows, 'misfit'):.2g} of the "
            "modes' products, on average")


def rows_of(one, word, count, draws, faster=1.0, weighed=False):
    """A row for each test and draw."""
    found = [(value, draw, one.errors(value, count, draw, faster, weighed))
             for value in one.study.test for draw in draws]
    return [(word, value, count, draw, faster, *got.errors, *got[1:5])
            for value, draw, got in found]


def mean(rows, column):
    """Of a column."""
    return float(np.mean([row[COLUMNS.index(column)] for row in rows]))


def share(run, name, rows, scale, note, **rule):
    """Record the mean error of rows, in per cent, and the largest; rule: as of `said`."""
    errors = PositionErrors(*(mean(rows, column) for column in PositionErrors._fields))
    worst = 100.0 * max(row[COLUMNS.index("origin")] for row in rows)
    said(run, name, errors, scale, f"{note}; mean of {len(rows)}, the largest {worst:.3g} %",
         **rule)


def said(run, name, errors, scale, note, fields=MODAL, **rule):
    """Record `PositionErrors` in per cent: the paper's, which depends on the origin, and others
    beside; fields: what they are, in words.
    """
    origin, centroid, displacement = (100.0 * error for error in errors)
    run.record(name, origin, unit="%", scale=scale, note=f"{note}; {fields}; {ORIGIN}; from the "
               f"centroid {centroid:.3g} %, of the displacement {displacement:.3g} %", **rule)
