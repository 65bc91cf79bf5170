"""Errors of the four schemes on torsion and on pokes (Tables 3, 5 and 6), compared with POD."""

import numpy as np

from mpm_ref.rom.study.errors import PositionErrors
from mpm_ref.rom.study.full_model import ldm_full_model
from mpm_ref.rom.study.run import SCHEMES, RunOptions
from mpm_ref.scene import build
from mpm_ref.trajectories import history

from ..common.position_errors import mean_errors
from ..common.registry import experiment
from ..common.scenes import threads_for
from .networks import SEEDS
from .references import References, record_errors, references
from .studies import POKES, TORSION, poked_again

DRAWS = {"torsion": 3, "poke": 2}    # of random samples
TESTED = 8          # of 24 pokes
POINTS = 50
POKED = 10          # times in a row, Table 6
R = {"torsion": 7, "poke": 6}
COLUMNS = ("scheme", "points", "net", "draw", "origin", "centroid", "displacement")


@experiment("ldm.table3", title="LDM: torsion and tension",
            profiles=("quick", "standard"), budget={"quick": 15, "standard": 1200})
def torsion(run):
    """Errors over test runs, training seeds and draws of samples; POD of the same dimension."""
    tests = references(TORSION, run.choose(quick=2, standard=None))
    rows = table(run, "ldm.table3", tests, [f"torsion-{seed}" for seed in range(SEEDS)])
    run.table("errors", COLUMNS, rows)


@experiment("ldm.table5", title="LDM: poke and recover",
            profiles=("quick", "standard"), budget={"quick": 25, "standard": 2400})
def pokes(run):
    """Errors over test runs and draws of samples; POD of the same dimension."""
    tests = references(POKES, run.choose(quick=1, standard=TESTED))
    run.table("errors", COLUMNS, table(run, "ldm.table5", tests, ["poke"]))


def table(run, name, tests, nets):
    """Record a table's errors, by scheme and number of samples; rows of all runs. At the standard
    profile also those of POD, which needs all training runs.
    """
    schemes = run.choose(quick=SCHEMES[1:2], standard=SCHEMES)
    draws, rows = range(run.choose(quick=1, standard=DRAWS[tests.study])), []
    for scheme in run.progress(schemes, "schemes"):
        for points in (POINTS, None):
            options = RunOptions(*scheme, points)
            results = [(net, draw, cached_errors(run, tests, net, options, draw)) for net in nets
                       for draw in (draws if points else range(1))]
            mean, note = mean_errors([errors for *_, errors in results], "trainings and draws")
            record_errors(run, f"{name}.{options.name}.{points or 'all'}", mean, tests.scale, note)
            rows += [(options.name, points or len(tests.X), net, draw, *errors)
                     for net, draw, errors in results]
    return rows + (compared_models(run, name, tests, nets, draws) if run.profile == "standard"
                   else [])


def cached_errors(run, tests, net, options, draw):
    """Return the `PositionErrors` of one draw of samples, which an interrupted run has cached."""
    return PositionErrors(*run.cached(f"{net}.{options.name}.{options.points}.{draw}",
                                      lambda: tests.network_errors(net, options, 1000 * draw)))


def compared_models(run, name, tests, nets, draws):
    """Record the errors of the nearest states of the learned maps, and of POD with the same
    samples; return their rows.
    """
    r = R[tests.study]
    models = {"nearest": mean_errors([tests.nearest_network_errors(net) for net in nets], "")[0],
              "pod.nearest": tests.nearest_pod_errors(r), "pod": tests.pod_errors(r, RunOptions()),
              f"pod.{POINTS}": mean_errors([tests.pod_errors(r, RunOptions(points=POINTS),
                                                             1000 * draw) for draw in draws],
                                           "")[0]}
    for word, errors in models.items():
        record_errors(run, f"{name}.{word}", errors, tests.scale, comparator="info")
    return [(word, POINTS if word.endswith("50") else len(tests.X), "", 0, *errors)
            for word, errors in models.items()]


@experiment("ldm.table6", title="LDM: ten pokes in a row",
            profiles=("standard",), budget={"standard": 900})
def in_a_row(run):
    """Errors of ten pokes one after the other, on the map that was trained on single ones."""
    tests, rows = poked_in_a_row(run.rng), []
    one = tests.cases[0]
    for scheme in run.progress(SCHEMES, "schemes"):
        for points in (POINTS, None):
            options = RunOptions(*scheme, points)
            errors = cached_errors(run, tests, "poke", options, 0)
            record_errors(run, f"ldm.table6.{options.name}.{points or 'all'}", errors, tests.scale)
            rows.append((options.name, points or len(one.X), "poke", 0, *errors))
    record_errors(run, "ldm.table6.pod", tests.pod_errors(R["poke"], RunOptions()), tests.scale,
                  comparator="info")
    run.table("errors", COLUMNS, rows)


def poked_in_a_row(rng):
    """Return the `References` of pokes one after the other, at POKED random angles."""
    scene = poked_again(rng.uniform(0.0, 2.0 * np.pi, POKED))
    one = ldm_full_model(scene)
    with threads_for(one.problem.bodies):
        return References(POKES.name, (one,), (history(build(scene)).x,), 1)
