"""Errors of reduced runs with inferred stress: bread, cake, metal frame, toothpaste and ball
(Table 1, sections 6.1 to 6.5), with fields of modes in place of networks.
"""

from ..common.registry import experiment
from .errors import (
    COLUMNS,
    MODES,
    error_rows,
    mean,
    record_all_samples,
    record_longer_steps,
    record_map_alone,
    record_mean,
    record_nearest,
    record_weighted,
    record_without_affine,
)
from .reduced_runs import fit_study
from .states import keep_states
from .studies import ball, bread, cake, metal, toothpaste

DRAWS = 3               # of samples


@experiment("nsf.metal", title="NSF: a metal frame is squeezed and let go",
            budget={"quick": 20, "standard": 600, "paper": 7200})
def frame(run):
    """Errors with 50, 30 and 20 samples (section 6.3)."""
    one = prepared(run, metal, train=5)
    record_counts(run, "nsf.metal", one, (50, 30, 20))
    keep_states(run, one, one.study.test[::3], ("stress",))


@experiment("nsf.toothpaste", title="NSF: toothpaste on a brush",
            budget={"quick": 20, "standard": 600, "paper": 7200})
def paste(run):
    """Errors with 50, 30 and 15 samples (Figures 10 and 11)."""
    one = prepared(run, toothpaste, train=5)
    record_counts(run, "nsf.toothpaste", one, (50, 30, 15))
    keep_states(run, one, one.study.test, ("weighed",))


@experiment("nsf.bread", title="NSF: a slice of bread is torn",
            budget={"quick": 20, "standard": 600, "paper": 7200})
def slice_of_bread(run):
    """Errors with 450 samples, and of the deformation-only model (Figure 5)."""
    record_with_map_alone(run, "nsf.bread", prepared(run, bread, train=6))


@experiment("nsf.ball", title="NSF: a squishy ball falls onto an incline",
            budget={"quick": 20, "standard": 600, "paper": 7200})
def squishy(run):
    """Errors with 300 samples, and of the deformation-only model (Figure 13)."""
    record_with_map_alone(run, "nsf.ball", prepared(run, ball))


@experiment("nsf.cake", title="NSF: a cake is cut",
            budget={"quick": 20, "standard": 900, "paper": 7200})
def cut(run):
    """Errors with 700 samples in the middle, and 400 in the second half (section 6.1)."""
    one = prepared(run, cake, train=5)
    rows = error_rows(one, "modal", one.study.samples, draws(run))
    record_mean(run, f"nsf.cake.error.{MODES}", rows, one.scale,
                "700, then 400 samples in the middle")
    printed_size = run.profile == "paper"
    run.record(f"nsf.cake.integration_particles.{MODES}" if printed_size else "nsf.cake.points",
               mean(rows, "points"), scale=one.scale, **({} if printed_size
                                                         else {"comparator": "info"}))
    rows += record_weighted(run, "nsf.cake.error", one, one.study.samples, draws(run))
    run.table("errors", COLUMNS, rows + record_variants(run, "nsf.cake", one))
    keep_states(run, one, one.study.test)


def prepared(run, study, **few):
    """Return the `FittedStudy` of a study at a profile; few: its settings at the quick one, which
    has one test.
    """
    quick = study(3, **few)
    return fit_study(run.choose(quick=quick._replace(test=quick.test[:1]), standard=study(2),
                                paper=study()))


def draws(run):
    """Return the numbers of a profile's draws of samples."""
    return range(run.choose(quick=1, standard=DRAWS, paper=DRAWS))


def record_counts(run, name, one, counts):
    """Record errors with several numbers of samples; at the quick profile with the first alone."""
    rows = []
    for count in run.choose(quick=counts[:1], standard=counts, paper=counts):
        drawn = error_rows(one, "modal", count, draws(run))
        record_mean(run, f"{name}.error.{count}.{MODES}", drawn, one.scale, f"{count} samples")
        rows += drawn + record_weighted(run, f"{name}.error.{count}", one, count, draws(run))
    rows += record_all_samples(run, name, one) + record_variants(run, name, one)
    run.table("errors", COLUMNS, rows)


def record_with_map_alone(run, name, one):
    """Record the errors of a study, and those of the map alone."""
    study = one.study
    few = error_rows(one, "modal", study.samples, draws(run))
    record_mean(run, f"{name}.error.{MODES}", few, one.scale, f"{study.samples} samples")
    few += record_weighted(run, f"{name}.error", one, study.samples, draws(run))
    rows = few + record_all_samples(run, name, one) + record_map_alone(run, name, one)
    keep_states(run, one, study.test[1:2] or study.test, ("map",))
    run.table("errors", COLUMNS, rows + record_variants(run, name, one))


def record_variants(run, name, one):
    """Record errors without the affine field and with longer steps, and those of the nearest states
    and training run; return the rows of the runs.
    """
    record_nearest(run, name, one)
    return record_longer_steps(run, name, one) + record_without_affine(run, name, one)
