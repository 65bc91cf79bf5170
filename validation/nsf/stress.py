"""The stress of reduced runs: how large its error is, what makes it, and whether it is less than
that of training runs that are looked up.

The paper prints no error of the stress; it says that the metal frame's matches "quantitatively"
(Figure 9, a map in colours) and that networks hardly represent high frequencies. A reduced run's
error has these parts, each measured alone:

    projection      of the full run's own stress on the modes: no coefficients are nearer
    coordinates     of the fields at the latent coordinates nearest to the full run's positions
    unsmoothed      likewise, of modes whose coefficients go through those of all snapshots
    all             of the run with all particles as samples
    samples         of the run with the study's samples

and the same stress has a distance from that of a full run with steps half as long.
"""

import numpy as np

from mpm_ref.rom.study.baselines import EVEN, interpolation_weights
from mpm_ref.rom.study.dataset import simulate_history
from mpm_ref.rom.study.evaluate import (
    history_reference,
    nearest_states,
    path_errors,
    square_sums,
    stress_share,
)

from ..common.registry import experiment
from ..common.rivals import INTERPOLATED, NEAREST, weighted_sum
from ..common.scenes import with_
from .networks import fields_of, trained
from .reduced_runs import fit_study, refit
from .rivals import STUDIES, study_of
from .states import history_points, run_points

SHARP = 1e-8            # smoothing of the coefficients that counts as none
EVERY = 2               # of the tests of a scene
FIGURE = "metal"        # scene of Figure 9
SHADE = 0.1             # of the range of colours
MOST_POINTS = 95        # of 100, that a picture shows
TWICE = 2.0             # the fields' own error, which a run should not exceed
LOOKUPS = NEAREST, INTERPOLATED
TRAINING, FULL = "training", "full"     # where a row is of no reduced run
PARTS = {
    NEAREST: "the training run with the nearest parameter",
    INTERPOLATED: "the interpolation of two training runs",
    "projection": "the full run's stress on the modes, which no coefficients come nearer to",
    "coordinates": "the fields at the coordinates nearest to the full run's positions",
    "unsmoothed": "likewise, of modes whose coefficients are not smoothed",
    "samples": "reduced runs on the study's samples",
    "all": "reduced runs on modes with all particles as samples",
    "refined": "of the full run, by one of steps half as long"}
COLUMNS = ("scene", "test", "fields", "part", "stress")


@experiment("nsf.stress", title="NSF: the stress of reduced runs, beside training runs",
            profiles=("quick", "standard"), budget={"quick": 60, "standard": 1200})
def compare_stress(run):
    """Record the parts of the error of the stress, on modes and, on the grid of their training, on
    networks, and that of training runs in their place; one draw of samples, every second test.
    """
    rows = []
    for name in run.progress(run.choose(quick=(FIGURE,), standard=tuple(STUDIES)), "scenes"):
        studies = {"modes": fit_study(study_of(run, name))}
        if run.profile == "standard":
            studies["networks"] = on_networks(run, name, studies["modes"])
        own = [(name, *row) for row in scene_rows(studies)]
        record_parts(run, f"nsf.stress.{name}", own, studies)
        rows += own
        if name == FIGURE:
            record_colours(run, studies)
    run.table("parts", COLUMNS, rows)


def on_networks(run, name, one):
    """Return a `FittedStudy` with the trained networks of its scene as fields; record the error of
    their stress on the training.
    """
    model = trained(f"{name}-waves")
    run.record(f"nsf.stress.{name}.networks.snapshots", 100.0 * model.about["errors"]["stress"],
               unit="%", comparator="info", scale=one.scale,
               note="of the networks at their own training snapshots, as stored with them")
    return one._replace(fields=fields_of(model, one.study), xhat=model.xhat)


def record_parts(run, target, rows, studies):
    """Record the means of a scene's rows, and the error of runs over those of training runs.
    studies: {fields: `FittedStudy`} of the rows.
    """
    one = studies["modes"]
    parts = dict.fromkeys(row[2:4] for row in rows)
    means = {part: np.mean([row[-1] for row in rows if row[2:4] == part]) for part in parts}
    for (fields, part), value in means.items():
        run.record(f"{target}.{fields}.{part}", 100.0 * value, unit="%", comparator="info",
                   scale=one.scale, note=f"{PARTS[part]}; Kirchhoff stress over its norm")
    for fields in studies:
        for lookup in LOOKUPS:
            run.record(f"{target}.{fields}.over.{lookup}",
                       means[fields, "samples"] / means[TRAINING, lookup], comparator="<=",
                       bound=1.0, scale=one.scale, note="error of the stress of reduced runs over "
                       f"that of {PARTS[lookup]}; above 1 they gain nothing over it")
        run.record(f"{target}.{fields}.over.coordinates",
                   means[fields, "samples"] / means[fields, "coordinates"], comparator="<=",
                   bound=TWICE, scale=one.scale, note="error of the stress of reduced runs over "
                   "that of the same fields at the nearest coordinates; above 2 the run adds more "
                   "than the fields lack")


def record_colours(run, studies):
    """Record how far the colours of Figure 9 are off: the size of the stress at some times, in the
    first test, over its range; below a tenth at 95 of 100 points the two pictures look alike.
    """
    for fields, one in studies.items():
        run.record(f"nsf.stress.{FIGURE}.{fields}.colours", colour_error(one, one.study.test[0]),
                   comparator="<=", bound=SHADE, scale=one.size, note="|| tau | - | tau' || over "
                   "the largest | tau' |, that which 95 of 100 points do not exceed; Figure 9 says "
                   "that stress is matched quantitatively, in colours")


def colour_error(one, value):
    """Return the difference of sizes of the stress that few points of a `FittedStudy`'s reduced run
    exceed, at the times of figures, over the largest size then; NaN where the run breaks down.
    """
    points = np.arange(len(one.runs.X))
    ours = run_points("run", one, value, points)["run_tau"]
    true = history_points("test", one.tests[value], 0, points)["test_tau"]
    return float(np.percentile(np.abs(ours - true), MOST_POINTS) / true.max())


def scene_rows(studies):
    """Yield rows of COLUMNS without the scene, of {fields: `FittedStudy`} on the same runs."""
    one = studies["modes"]
    sharp = refit(one, one.study.sizes._replace(smoothing=SHARP), one.study.follows)
    for value in one.study.test[::EVERY]:
        for lookup, error in lookup_errors(one.runs, value, one.tests[value].tau[0]).items():
            yield value, TRAINING, lookup, error
        yield value, "modes", "projection", projection_error(one, value)
        yield value, "modes", "unsmoothed", nearest_error(sharp, value)
        yield value, "modes", "all", one.errors(value, len(one.runs.X)).stress
        for fields, own in studies.items():
            yield value, fields, "coordinates", nearest_error(own, value)
            yield value, fields, "samples", own.errors(value, one.study.samples).stress
        yield value, FULL, "refined", refined_error(one, value)


def lookup_errors(runs, value, reference):
    """Return {lookup: error} of training runs in place of a test with stresses (k + 1, n, 6) [Pa];
    of several that are equally near the least.
    """
    off = (runs.mu[:, 0] - value) ** 2
    weights = interpolation_weights(runs.mu, np.array([value]))
    return {NEAREST: min(history_error(runs.tau[k], reference)
                         for k in np.flatnonzero(off <= off.min() + EVEN)),
            INTERPOLATED: history_error(weighted_sum(weights, runs.tau), reference)}


def history_error(tau, reference):
    """Return the error of stresses (k + 1, n, 6) at all times but the first, over their norm."""
    return stress_share(sum(map(square_sums, *(a[1:].astype(float) for a in (tau, reference)))))


def projection_error(one, value):
    """Return the error of the nearest sums of the modes of a `FittedStudy` to a test's stress."""
    modes = one.fields.tau.modes.reshape(-1, one.study.sizes.tau)
    sums = np.zeros(2)
    for tau in one.tests[value].tau[0, 1:]:
        reference = tau.astype(float).ravel()
        square = reference @ reference
        sums += square - np.sum((reference @ modes) ** 2), square
    return stress_share(sums)


def nearest_error(one, value):
    """Return the error of the stress of a `FittedStudy`'s fields at the latent coordinates whose
    positions are nearest to those of a test.
    """
    test, fields = one.tests[value], one.fields_of_run(value)
    states = nearest_states(fields, test.x[0], one.rest)
    return stress_share(path_errors(fields, history_reference(test), states).stress)


def refined_error(one, value):
    """Return the error of the stress of the full run of a test by one of steps half as long."""
    study = one.study
    scene = study.run(value)
    finer = simulate_history(with_(scene, dt=0.5 * scene.dt, steps=2 * scene.steps), [value],
                             np.float32, 2 * study.spacing)
    return history_error(one.tests[value].tau[0], finer.tau[0])
