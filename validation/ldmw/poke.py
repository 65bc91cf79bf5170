"""The poking test (LDMW-poke): 27 runs, five latent coordinates, fifteen sample points."""

import numpy as np

from mpm_ref.rom.sampling import draw

from ..common.registry import experiment
from ..ldm.networks import trained
from ..ldm.reduced_runs import reconstructed
from ..ldm.workshop_studies import PUSHES
from .runs import Fields, by_nodes, by_points, kept, pod, record, runs

NET, R, HYPER = "push", 5, 15
DRAWS = 3                   # of sample points


@experiment("ldmw.poke", title="LDM workshop: poking test",
            profiles=("quick", "standard"), budget={"quick": 30, "standard": 200})
def poke(run):
    """Errors over training and test runs: of the map, and of POD."""
    few = run.choose(quick=1, standard=None)
    tests, known = (runs(PUSHES, numbers[:few]) for numbers in (PUSHES.test, PUSHES.train))
    chosen = [samples(tests.cases[0], seed) for seed in range(run.choose(quick=1, standard=DRAWS))]
    near = [kept(NET, tests.cases[0], own) for own in chosen]
    points = [by_points(own, around) for own, around in zip(chosen, near, strict=True)]
    for name, of in (("train", known), ("test", tests)):
        found = [of.of_net(NET, approach) for approach in run.progress(points, name)]
        mean, words = averaged(found)
        run.record(f"ldmw.poke.{name}_error", 100.0 * mean.position, scale=of.scale, note=words)
        record(run, f"ldmw.poke.{name}", mean, of.scale, words, comparator="info")
    run.record("ldmw.poke.neighbours", np.mean([len(around.around) for around in near]), unit="1",
               scale=tests.scale, comparator="info",
               note=f"of {HYPER} sample points, in all training states")
    if run.profile == "standard":
        beside(run, tests, chosen)


def beside(run, tests, chosen):
    """Record test errors with all points, with the sample points' nodes, of POD, and of nearest
    states, without dynamics.
    """
    every, map, of = np.arange(len(tests.X)), pod(PUSHES, R), trained(NET)
    for name, own in (("nearest", (of.field, of.rest)), ("pod.nearest", map)):
        share = reconstructed(tests.X, tests.full.x, *own).origin
        run.record(f"ldmw.poke.{name}.position", 100.0 * share, unit="%", scale=tests.scale,
                   comparator="info", note="of the map's nearest states")
    found = {"all": [tests.of_net(NET, by_points(every))],
             "node": [tests.of_net(NET, by_nodes(own)) for own in chosen],
             "pod.all": [tests.errors(*map, by_points(every))],
             "pod": [tests.errors(*map, by_points(own)) for own in chosen]}
    for name, errors in found.items():
        mean, words = averaged(errors)
        record(run, f"ldmw.poke.{name}", mean, tests.scale, words, comparator="info")


def samples(one, seed):
    """Sample points: five each of what is held and what is pushed, the others anywhere."""
    pick = draw(len(one.X), HYPER, R, one.X.shape[1], one.constrained_points(0.0))
    return pick(np.random.default_rng(seed))


def averaged(found):
    """Mean of several `Fields`, and in words: of how many, and the largest position error."""
    worst = 100.0 * max(fields.position for fields in found)
    return (Fields(*np.mean(found, axis=0)),
            f"mean of {len(found)} draws of sample points, at most {worst:.3g} % in position")
