"""The cylinder under gravity, reduced: loss, latent dimension, sample points (Figures 7 to 10)."""

import numpy as np

from mpm_ref.rom.latent import VELOCITIES
from mpm_ref.rom.study.run import PROJECTIONS, SCHEMES, RunOptions

from ..common.position_errors import mean_errors
from ..common.registry import experiment
from .networks import BOTH, REPEATED, TERMS
from .references import record_errors, references
from .studies import GRAVITY

POINTS = (10, 25, 50, 100, 300, None)
DRAWS = 3                   # of random samples, each a run of its own
SAME = 1.1                  # errors within this factor are as good


@experiment("ldm.fig7", title="LDM: which terms of the loss are needed",
            profiles=("quick", "standard"), budget={"quick": 15, "standard": 400})
def terms(run):
    """Errors of all four schemes with and without the loss's terms, r = 7, all points."""
    tests, rows = test_runs(run), []
    for trained_with in run.progress(TERMS, "losses"):
        name = "gravity-r7" + ("" if trained_with == BOTH else f"-{trained_with}")
        for options in schemes(run):
            errors = tests.network_errors(name, options)
            record_errors(run, f"ldm.fig7.{options.name}.{trained_with}", errors, tests.scale,
                          comparator="info")
            rows.append((options.name, *(weight > 0.0 for weight in TERMS[trained_with]), *errors))
    record_errors(run, "ldm.fig7.printed-weights",
                  tests.network_errors("gravity-r7-printed", RunOptions()), tests.scale,
                  "lambda_F = 100 and lambda_v = 0.01 in SI units, Lagrangian and linear",
                  comparator="info")
    record_worst(run, "ldm.fig7.scale_max", rows, tests)
    run.table("errors", ("scheme", "F", "v", "origin", "centroid", "displacement"), rows)


@experiment("ldm.velocity", title="LDM: the velocity that a reduced state stands for",
            profiles=("quick", "standard"), budget={"quick": 10, "standard": 60})
def velocity(run):
    """Errors of the choices of `rom.latent`, r = 4, Lagrangian, all points."""
    tests, rows = test_runs(run), []
    for projection in PROJECTIONS:
        for choice in run.progress(VELOCITIES, projection):
            options = RunOptions(projection=projection, velocity=choice)
            errors = tests.network_errors("gravity-r4", options)
            record_errors(run, f"ldm.velocity.{choice}.{projection}", errors, tests.scale,
                          "as printed" if choice == "latest" else "", comparator="info")
            rows.append((choice, projection, *errors))
    run.table("errors", ("velocity", "projection", "origin", "centroid", "displacement"), rows)


@experiment("ldm.fig8", title="LDM: error and latent dimension",
            profiles=("quick", "standard"), budget={"quick": 15, "standard": 700})
def dimensions(run):
    """Errors of all four schemes for r = 1 .. 7, compared with POD of the same dimension."""
    tests, rows, compared = test_runs(run), [], []
    for r in run.progress(run.choose(quick=(2, 4), standard=range(1, 8)), "r"):
        name = f"gravity-r{r}"
        rows += [(r, options.name, *tests.network_errors(name, options))
                 for options in schemes(run)]
        compared += [(r, "nearest", *tests.nearest_network_errors(name)),
                     (r, "pod", *tests.pod_errors(r, RunOptions())),
                     (r, "pod.nearest", *tests.nearest_pod_errors(r))]
    for r, name, *errors in rows + compared:
        record_errors(run, f"ldm.fig8.r{r}.{name}", errors, tests.scale, comparator="info")
    record_worst(run, "ldm.fig8.axis_max", rows, tests)
    run.table("errors", ("r", "scheme", "origin", "centroid", "displacement"), rows + compared)


@experiment("ldm.fig9", title="LDM: error and number of sample points",
            profiles=("quick", "standard"), budget={"quick": 15, "standard": 900})
def samples(run):
    """Errors of all four schemes at r = 4 by number of samples, over several random draws; POD with
    the same samples.
    """
    tests, rows = test_runs(run), []
    for count in run.progress(run.choose(quick=(10, 100), standard=POINTS), "points"):
        draws = range(run.choose(quick=1, standard=DRAWS) if count else 1)
        for options in schemes(run, count):
            errors = [tests.network_errors("gravity-r4", options, 1000 * k) for k in draws]
            rows += record_draws(run, options.name, count, errors, tests)
        errors = [tests.pod_errors(4, RunOptions(points=count), 1000 * k) for k in draws]
        rows += record_draws(run, "pod", count, errors, tests)
    learned = [row for row in rows if row[0] != "pod"]
    record_worst(run, "ldm.fig9.error_at_10", [row for row in learned if row[1] == 10], tests)
    record_worst(run, "ldm.fig9.axis_max", learned, tests)
    if run.profile == "standard":
        run.record("ldm.fig9.points_equal_all", sufficient_points(learned, len(tests.X)),
                   scale=tests.scale,
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
        for options in (own for count in (-(-r // 3), 10, 100) for own in schemes(run, count)):
            rows.append((options.name, options.points, r, terms,
                         *tests.network_errors(name, options)))
    record_worst(run, "ldm.fig10.error_10_100",
                 [row for row in rows if row[1] >= 10 and row[2] > 1 and row[3] == BOTH], tests)
    record_worst(run, "ldm.fig10.error_one_point", [row for row in rows if row[1] == 1], tests)
    run.table("errors", ("scheme", "points", "r", "loss", "origin", "centroid", "displacement"),
              rows)


def test_runs(run):
    """Return the `References` of a profile."""
    return references(GRAVITY, run.choose(quick=2, standard=None))


def schemes(run, points=None):
    """Return the `RunOptions` of the schemes of a profile, with a number of samples."""
    chosen = run.choose(quick=SCHEMES[1:2], standard=SCHEMES)
    return [RunOptions(*scheme, points) for scheme in chosen]


def record_draws(run, name, count, errors, tests):
    """Record the mean errors of several draws; return a row for each."""
    mean, note = mean_errors(errors, "draws of samples")
    record_errors(run, f"ldm.fig9.{name}.{count or 'all'}", mean, tests.scale, note,
                  comparator="info")
    return [(name, count or len(tests.X), k, *one) for k, one in enumerate(errors)]


def record_worst(run, target, rows, tests):
    """Record the largest error of rows (.., origin, centroid, displacement) as a printed number;
    only of the whole study.
    """
    if run.profile == "standard":
        *what, origin, centroid, displacement = max(rows, key=lambda row: row[-3])
        record_errors(run, target, (origin, centroid, displacement), tests.scale,
                      f"the largest of {len(rows)}: {', '.join(map(str, what))}")


def sufficient_points(rows, total):
    """Return the least number of points from which on the mean errors of all schemes are as good as
    with all.
    """
    def mean(scheme, points):
        return np.mean([row[3] for row in rows if row[:2] == (scheme, points)])

    names, counts = {row[0] for row in rows}, sorted({row[1] for row in rows})
    good = [all(mean(s, c) <= SAME * mean(s, total) for s in names) for c in counts]
    return next(c for k, c in enumerate(counts) if all(good[k:]))
