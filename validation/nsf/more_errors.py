"""Errors of reduced runs with inferred stress: bread, cake, metal frame, toothpaste and ball
(Table 1, sections 6.1 to 6.5), with fields of modes in place of networks.
"""

from ..common.registry import experiment
from .errors import (
    COLUMNS,
    by_cubature,
    compared,
    known,
    longer,
    map_alone,
    mean,
    rows_of,
    share,
    without_affine,
)
from .reduced_runs import tested
from .states import keep_states
from .studies import ball, bread, cake, metal, toothpaste

DRAWS = 3               # of samples


@experiment("nsf.metal", title="NSF: a metal frame is squeezed and let go",
            budget={"quick": 20, "standard": 600, "paper": 7200})
def frame(run):
    """Errors with 50, 30 and 20 samples (section 6.3)."""
    one = prepared(run, metal, train=5)
    counted(run, "nsf.metal", one, (50, 30, 20))
    keep_states(run, one, one.study.test[::3], ("stress",))


@experiment("nsf.toothpaste", title="NSF: toothpaste on a brush",
            budget={"quick": 20, "standard": 600, "paper": 7200})
def paste(run):
    """Errors with 50, 30 and 15 samples (Figures 10 and 11)."""
    one = prepared(run, toothpaste, train=5)
    counted(run, "nsf.toothpaste", one, (50, 30, 15))
    keep_states(run, one, one.study.test, ("weighed",))


@experiment("nsf.bread", title="NSF: a slice of bread is torn",
            budget={"quick": 20, "standard": 600, "paper": 7200})
def slice_of_bread(run):
    """Errors with 450 samples, and of the deformation-only model (Figure 5)."""
    beside_the_map(run, "nsf.bread", prepared(run, bread, train=6))


@experiment("nsf.ball", title="NSF: a squishy ball falls onto an incline",
            budget={"quick": 20, "standard": 600, "paper": 7200})
def squishy(run):
    """Errors with 300 samples, and of the deformation-only model (Figure 13)."""
    beside_the_map(run, "nsf.ball", prepared(run, ball))


@experiment("nsf.cake", title="NSF: a cake is cut",
            budget={"quick": 20, "standard": 900, "paper": 7200})
def cut(run):
    """Errors with 700 samples in the middle, and 400 in the second half (section 6.1)."""
    one = prepared(run, cake, train=5)
    rows = rows_of(one, "modal", one.study.samples, draws(run))
    share(run, "nsf.cake.error", rows, one.scale, "700, then 400 samples in the middle")
    whole = run.profile == "paper"
    run.record("nsf.cake.integration_particles" if whole else "nsf.cake.points",
               mean(rows, "points"), scale=one.scale, **({} if whole else {"comparator": "info"}))
    rows += by_cubature(run, "nsf.cake.cubature", one, one.study.samples, draws(run))
    run.table("errors", COLUMNS, rows + finished(run, "nsf.cake", one))
    keep_states(run, one, one.study.test)


def prepared(run, study, **few):
    """`Tested` of a study at a run's profile; few: its settings at the quick one, which has one
    test.
    """
    quick = study(3, **few)
    return tested(run.choose(quick=quick._replace(test=quick.test[:1]), standard=study(2),
                             paper=study()))


def draws(run):
    """Of samples."""
    return range(run.choose(quick=1, standard=DRAWS, paper=DRAWS))


def counted(run, name, one, counts):
    """Record errors with several numbers of samples, the most alone at the quick profile."""
    rows = []
    for count in run.choose(quick=counts[:1], standard=counts, paper=counts):
        found = rows_of(one, "modal", count, draws(run))
        share(run, f"{name}.error.{count}", found, one.scale, f"{count} samples")
        rows += found + by_cubature(run, f"{name}.cubature.{count}", one, count, draws(run))
    run.table("errors", COLUMNS, rows + compared(run, name, one) + finished(run, name, one))


def beside_the_map(run, name, one):
    """Record errors, and those of the map alone."""
    study = one.study
    few = rows_of(one, "modal", study.samples, draws(run))
    share(run, f"{name}.error", few, one.scale, f"{study.samples} samples")
    few += by_cubature(run, f"{name}.cubature", one, study.samples, draws(run))
    rows = few + compared(run, name, one) + map_alone(run, name, one)
    keep_states(run, one, study.test[1:2] or study.test, ("map",))
    run.table("errors", COLUMNS, rows + finished(run, name, one))


def finished(run, name, one):
    """Record settings, and errors without the affine field, with longer steps, and of what is known
    without a run; rows of the runs.
    """
    run.record(f"{name}.r", one.study.sizes.r, scale=one.scale)
    known(run, name, one)
    return longer(run, name, one) + without_affine(run, name, one)
