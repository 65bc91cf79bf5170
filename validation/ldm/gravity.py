"""The cylinder under gravity, reduced: loss, latent dimension, sample points (Figures 7 to 10)."""

import numpy as np

from mpm_ref.rom.latent import VELOCITIES
from mpm_ref.rom.study.run import PROJECTIONS, SCHEMES, RunOptions

from ..common.registry import experiment
from .networks import BOTH, REPEATED, TERMS
from .references import mean_of, references, share
from .studies import GRAVITY

POINTS = (10, 25, 50, 100, 300, None)
DRAWS = 3                   # of random samples, each a run of its own
SAME = 1.1                  # errors within this factor are as good


@experiment("ldm.fig7", title="LDM: which terms of the loss are needed",
            profiles=("quick", "standard"), budget={"quick": 15, "standard": 400})
def terms(run):
    """Errors of all four schemes with and without the loss's terms, r = 7, all points."""
    tests, rows = some(run)
    for trained_with in run.progress(TERMS, "losses"):
        name = "gravity-r7" + ("" if trained_with == BOTH else f"-{trained_with}")
        for way in ways(run):
            found = tests.errors(name, way)
            share(run, f"ldm.fig7.{way.name}.{trained_with}", found, tests.scale, comparator="info")
            rows.append((way.name, *(weight > 0.0 for weight in TERMS[trained_with]), *found))
    share(run, "ldm.fig7.printed-weights", tests.errors("gravity-r7-printed", RunOptions()),
          tests.scale,
          "lambda_F = 100 and lambda_v = 0.01 in SI units, Lagrangian and linear",
          comparator="info")
    worst(run, "ldm.fig7.scale_max", rows, tests)
    run.table("errors", ("scheme", "F", "v", "origin", "centroid", "displacement"), rows)


@experiment("ldm.velocity", title="LDM: the velocity that a reduced state stands for",
            profiles=("quick", "standard"), budget={"quick": 10, "standard": 60})
def velocity(run):
    """Errors of the choices of `rom.latent`, r = 4, Lagrangian, all points."""
    tests, rows = some(run)
    for projection in PROJECTIONS:
        for choice in run.progress(VELOCITIES, projection):
            found = tests.errors("gravity-r4", RunOptions(projection=projection, velocity=choice))
            share(run, f"ldm.velocity.{choice}.{projection}", found, tests.scale,
                  "as printed" if choice == "latest" else "", comparator="info")
            rows.append((choice, projection, *found))
    run.table("errors", ("velocity", "projection", "origin", "centroid", "displacement"), rows)


@experiment("ldm.fig8", title="LDM: error and latent dimension",
            profiles=("quick", "standard"), budget={"quick": 15, "standard": 700})
def dimensions(run):
    """Errors of all four schemes for r = 1 .. 7, beside POD of the same dimension."""
    (tests, rows), beside = some(run), []
    for r in run.progress(run.choose(quick=(2, 4), standard=range(1, 8)), "r"):
        name = f"gravity-r{r}"
        rows += [(r, way.name, *tests.errors(name, way)) for way in ways(run)]
        beside += [(r, "nearest", *tests.nearest(name)), (r, "pod", *tests.linear(r, RunOptions())),
                   (r, "pod.nearest", *tests.nearest_linear(r))]
    for r, name, *found in rows + beside:
        share(run, f"ldm.fig8.r{r}.{name}", found, tests.scale, comparator="info")
    worst(run, "ldm.fig8.axis_max", rows, tests)
    run.table("errors", ("r", "scheme", "origin", "centroid", "displacement"), rows + beside)


@experiment("ldm.fig9", title="LDM: error and number of sample points",
            profiles=("quick", "standard"), budget={"quick": 15, "standard": 900})
def samples(run):
    """Errors of all four schemes at r = 4 by number of samples, over several random draws; POD with
    the same samples.
    """
    tests, rows = some(run)
    for count in run.progress(run.choose(quick=(10, 100), standard=POINTS), "points"):
        draws = range(run.choose(quick=1, standard=DRAWS) if count else 1)
        for way in ways(run, count):
            found = [tests.errors("gravity-r4", way, 1000 * k) for k in draws]
            rows += of_draws(run, way.name, count, found, tests)
        found = [tests.linear(4, RunOptions(points=count), 1000 * k) for k in draws]
        rows += of_draws(run, "pod", count, found, tests)
    own = [row for row in rows if row[0] != "pod"]
    worst(run, "ldm.fig9.error_at_10", [row for row in own if row[1] == 10], tests)
    worst(run, "ldm.fig9.axis_max", own, tests)
    if run.profile == "standard":
        run.record("ldm.fig9.points_equal_all", enough(own, len(tests.X)), scale=tests.scale,
                   note=f"from here on the means of all schemes are within {SAME:g} of theirs with "
                   "all points")
    run.table("errors", ("scheme", "points", "draw", "origin", "centroid", "displacement"), rows)


@experiment("ldm.fig10", title="LDM: loss, latent dimension and sample points together",
            profiles=("standard",), budget={"standard": 900})
def together(run):
    """Errors by scheme, number of samples, loss and r, one draw of samples each."""
    tests, rows = references(GRAVITY), []
    names = {(r, BOTH): f"gravity-r{r}" for r in (1, 4)} | {
        (r, terms): f"gravity-r{r}" + ("" if terms == BOTH else f"-{terms}")
        for r in REPEATED for terms in TERMS}
    for (r, terms), name in run.progress(names.items(), "maps"):
        for way in (way for count in (-(-r // 3), 10, 100) for way in ways(run, count)):
            rows.append((way.name, way.points, r, terms, *tests.errors(name, way)))
    worst(run, "ldm.fig10.error_10_100",
          [row for row in rows if row[1] >= 10 and row[2] > 1 and row[3] == BOTH], tests)
    worst(run, "ldm.fig10.error_one_point", [row for row in rows if row[1] == 1], tests)
    run.table("errors", ("scheme", "points", "r", "loss", "origin", "centroid", "displacement"),
              rows)


def some(run):
    """Test runs of a profile, and an empty list of rows."""
    return references(GRAVITY, run.choose(quick=2, standard=None)), []


def ways(run, points=None):
    """The schemes of a profile, with so many samples."""
    chosen = run.choose(quick=SCHEMES[1:2], standard=SCHEMES)
    return [RunOptions(*scheme, points) for scheme in chosen]


def of_draws(run, name, count, found, tests):
    """Record the mean of several draws; a row for each."""
    mean, words = mean_of(found, "draws of samples")
    share(run, f"ldm.fig9.{name}.{count or 'all'}", mean, tests.scale, words, comparator="info")
    return [(name, count or len(tests.X), k, *errors) for k, errors in enumerate(found)]


def worst(run, target, rows, tests):
    """Record the largest error of rows (.., origin, centroid, displacement) as a printed number;
    only of the whole study.
    """
    if run.profile == "standard":
        *what, origin, centroid, displacement = max(rows, key=lambda row: row[-3])
        share(run, target, (origin, centroid, displacement), tests.scale,
              f"the largest of {len(rows)}: {', '.join(map(str, what))}")


def enough(rows, everything):
    """The fewest points from which on the mean errors of all schemes are as good as with all."""
    def mean(scheme, points):
        return np.mean([row[3] for row in rows if row[:2] == (scheme, points)])

    schemes, counts = {row[0] for row in rows}, sorted({row[1] for row in rows})
    good = [all(mean(s, c) <= SAME * mean(s, everything) for s in schemes) for c in counts]
    return next(c for k, c in enumerate(counts) if all(good[k:]))
