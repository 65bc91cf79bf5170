"""How long NCLaw's laws take (Table 3): half a second of each environment."""

from time import perf_counter, process_time

import numpy as np

from mpm_ref.laws.compare import positions
from mpm_ref.nclaw.bodies import learned, own
from mpm_ref.scene import build

from ..registry import experiment
from ..verification.scenes import threads_for, with_
from .environments import ENVIRONMENTS, environment
from .errors import PRINTED
from .nets import trained
from .waiting import there

REPEATS = 3
COLUMNS = ("environment", "laws", "wall", "cpu")
NOTE = "median wall time of {} runs in turn, start not counted; printed: on a graphics processor"


@experiment("nclaw.table3", title="NCLaw: times of runs",
            profiles=("quick", "standard"), budget={"quick": 15, "standard": 90})
def table3(run):
    """Ours beside the true laws, in turn, on the threads that are given; for orientation, since the
    paper's machine is another.
    """
    steps, rows = run.choose(quick=20, standard=1000), []
    for name, found in run.progress(there(run, ENVIRONMENTS, trained).items(), "environments"):
        scene = environment(name, steps=steps, every=steps)
        laws = {"ours": learned(found), "true": own}
        for law in laws.values():
            took(with_(scene, steps=1, every=1), law)       # compiles
        times = [{word: took(scene, law) for word, law in laws.items()} for _ in range(REPEATS)]
        rows += [(name, word, *one[word]) for one in times for word in laws]
        record(run, name, times, steps)
    run.table("times", COLUMNS, rows)


def took(scene, law):
    """Wall and CPU time [s] of a run."""
    problem = build(scene)
    bodies = tuple(map(law, problem.bodies))
    with threads_for(problem.bodies):
        run = positions(problem, bodies)
        next(run)
        wall, cpu = perf_counter(), process_time()
        for _ in run:
            pass
        return perf_counter() - wall, process_time() - cpu


def record(run, name, times, steps):
    """Record the time of ours, and how many times that of the true laws it is."""
    wall, cpu = np.median([one["ours"] for one in times], axis=0)
    scale = f"1000 particles, {steps} steps"
    target = f"nclaw.table3.ours.{PRINTED[name]}"
    run.record(target, wall, comparator="info", scale=scale, note=NOTE.format(REPEATS))
    run.record(f"{target}.cpu", cpu / (1000 * steps), unit="s", comparator="info", scale=scale,
               note="CPU time of a step, per particle")
    run.record(f"{target}.over_true", cpu / np.median([one["true"][1] for one in times]), unit="1",
               comparator="info", scale=scale, note="CPU time, beside the true laws")
