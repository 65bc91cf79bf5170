"""Times of NCLaw's laws and graph networks (Table 3): half a second of each environment."""

from time import perf_counter, process_time

import numpy as np

from mpm_ref.core.blas import one_thread
from mpm_ref.nclaw.bodies import body_maker, copy_body
from mpm_ref.nclaw.study.compare import RunBroken
from mpm_ref.scene import build

from ..common.registry import experiment
from ..common.scenes import threads_for, with_
from ..common.weights_needed import load_available
from .environments import ENVIRONMENTS, environment
from .errors import OURS, run_of_laws
from .evaluate import frames
from .printed_ids import PRINTED, extended
from .simulators import GraphNet
from .trained_laws import nets, trained, weights_of

REPEATS = {"quick": 3, "standard": 10}
TRUE = "true"
METHODS = (OURS, "gnn")
SINGLE = "single"       # ours, with layers in single precision
MOST_CPU = 1.2e-6       # [s] for a step of a particle in single
COLUMNS = ("environment", "laws", "wall", "cpu")
NOTE = "median wall time of {} runs in turn, start not counted; printed: on a graphics processor"
LOST = "broke down, so that no time stands here"


@experiment("nclaw.table3", title="NCLaw: times of runs",
            profiles=("quick", "standard"), budget={"quick": 15, "standard": 1200})
def table3(run):
    """Ours, also in single precision, and graph networks and the true laws, in turn, on the threads
    that are given; for orientation, since the paper's machine is another.
    """
    steps, rows, single = run.choose(quick=20, standard=1000), [], []
    names = [weights_of(word, name) for name in ENVIRONMENTS for word in METHODS]
    models = load_available(run, names, trained)
    for name in run.progress(ENVIRONMENTS, "environments"):
        laws = methods(name, models)
        if laws:
            times = timed(environment(name, steps=steps), {**laws, TRUE: copy_body},
                          REPEATS[run.profile])
            rows += [(name, word, *one) for word, repeats in times.items() for one in repeats]
            for word in laws:
                cpu = record(run, (name, word), times, steps)
                single += [cpu] * (word == SINGLE)
    if single:
        run.record(f"nclaw.table3.{SINGLE}.cpu", np.max(single), unit="s", comparator="<=",
                   bound=MOST_CPU, scale=f"1000 particles, {steps} steps",
                   note=f"CPU time of a step, per particle, the largest of {len(single)}")
    run.table("times", COLUMNS, rows)


def methods(name, models):
    """Return {method: argument of `frames`} of an environment, for methods that have `models`."""
    names = {word: weights_of(word, name) for word in METHODS}
    found = {word: run_of_laws(models[key]) for word, key in names.items() if key in models}
    if OURS in found:
        found[SINGLE] = body_maker(models[names[OURS]], precision="single")
    return found


def timed(scene, laws, repeats):
    """Return {name: [(wall, CPU)]} [s] of runs of a scene by {name: law}, in turn."""
    for law in laws.values():
        run_times(with_(scene, steps=scene.every), law)      # compiles
    turns = [{word: run_times(scene, law) for word, law in laws.items()} for _ in range(repeats)]
    return {word: [one[word] for one in turns] for word in laws}


def run_times(scene, law):
    """Return the wall and CPU time [s] of a run; NaN of one that broke down. Products of graph
    networks have one thread: more would spin for a moment in the run that comes next.
    """
    problem = build(scene)
    with threads_for(problem.bodies), one_thread():
        run = frames(problem, law)
        next(run)
        wall, cpu = perf_counter(), process_time()
        try:
            for _ in run:
                pass
        except RunBroken:
            return np.nan, np.nan
        return perf_counter() - wall, process_time() - cpu


def record(run, key, times, steps):
    """Record the time of a method in an environment, and how many times that of the true laws it
    is; key: their names. Returns the CPU time of a step, per particle.
    """
    (name, word), scale = key, f"1000 particles, {steps} steps"
    wall, cpu = np.median(times[word], axis=0)
    net = nets()[weights_of(OURS if word == SINGLE else word, name)]
    notes = [NOTE.format(len(times[word])), net.description if isinstance(net, GraphNet) else "",
             "" if np.isfinite(wall) else LOST]
    target, rule = f"nclaw.table3.{word}.{PRINTED[name]}", {"comparator": "info", "scale": scale}
    own = {"unit": "s", **rule} if word == SINGLE else {"scale": scale}
    run.record(extended(target, ("narrow",) * isinstance(net, GraphNet)), wall,
               note="; ".join(filter(None, notes)), **own)
    run.record(f"{target}.cpu", cpu / (1000 * steps), unit="s",
               note="CPU time of a step, per particle", **rule)
    run.record(f"{target}.over_true", cpu / np.median(times[TRUE], axis=0)[1], unit="1",
               note="CPU time, beside the true laws", **rule)
    return cpu / (1000 * steps)
