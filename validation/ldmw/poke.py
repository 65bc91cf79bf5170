"""The poking test (LDMW-poke): 27 runs, five latent coordinates, fifteen sample points."""

import numpy as np

from mpm_ref.rom.sampling import draw

from ..common.registry import experiment
from ..ldm.networks import trained
from ..ldm.references import nearest_state_errors
from ..ldm.workshop_studies import PUSHES
from .runs import FieldErrors, by_nodes, by_points, pod, record, study_runs, training_neighbours

NET, R, HYPER = "push", 5, 15
DRAWS = 3                   # of sample points


@experiment("ldmw.poke", title="LDM workshop: poking test",
            profiles=("quick", "standard"), budget={"quick": 30, "standard": 200})
def poke(run):
    """Errors over training and test runs: of the map, and of POD."""
    few = run.choose(quick=1, standard=None)
    tests, training = (study_runs(PUSHES, numbers[:few]) for numbers in (PUSHES.test, PUSHES.train))
    chosen = [samples(tests.cases[0], seed) for seed in range(run.choose(quick=1, standard=DRAWS))]
    near = [training_neighbours(NET, tests.cases[0], own) for own in chosen]
    points = [by_points(own, around) for own, around in zip(chosen, near, strict=True)]
    for name, own in (("train", training), ("test", tests)):
        errors = [own.network_errors(NET, approach) for approach in run.progress(points, name)]
        mean, note = mean_errors(errors)
        run.record(f"ldmw.poke.{name}_error", 100.0 * mean.position, scale=own.scale, note=note)
        record(run, f"ldmw.poke.{name}", mean, own.scale, note, comparator="info")
    run.record("ldmw.poke.neighbours", np.mean([len(around.around) for around in near]), unit="1",
               scale=tests.scale, comparator="info",
               note=f"of {HYPER} sample points, in all training states")
    if run.profile == "standard":
        record_compared(run, tests, chosen)


def record_compared(run, tests, chosen):
    """Record test errors with all points, with the sample points' nodes, of POD, and of nearest
    states, without dynamics.
    """
    every, modes, model = np.arange(len(tests.X)), pod(PUSHES, R), trained(NET)
    for name, own in (("nearest", (model.field, model.rest)), ("pod.nearest", modes)):
        share = nearest_state_errors(tests.X, tests.full.x, *own).origin
        run.record(f"ldmw.poke.{name}.position", 100.0 * share, unit="%", scale=tests.scale,
                   comparator="info", note="of the map's nearest states")
    approaches = {"all": [tests.network_errors(NET, by_points(every))],
                  "node": [tests.network_errors(NET, by_nodes(own)) for own in chosen],
                  "pod.all": [tests.errors(*modes, by_points(every))],
                  "pod": [tests.errors(*modes, by_points(own)) for own in chosen]}
    for name, errors in approaches.items():
        mean, note = mean_errors(errors)
        record(run, f"ldmw.poke.{name}", mean, tests.scale, note, comparator="info")


def samples(one, seed):
    """Draw the sample points: five that are held, five that are pushed, the others anywhere."""
    pick = draw(len(one.X), HYPER, R, one.X.shape[1], one.constrained_points(0.0))
    return pick(np.random.default_rng(seed))


def mean_errors(errors):
    """Return the mean of several `FieldErrors`, and a note on their number and the largest."""
    worst = 100.0 * max(one.position for one in errors)
    return (FieldErrors(*np.mean(errors, axis=0)),
            f"mean of {len(errors)} draws of sample points, at most {worst:.3g} % in position")
