"""Memory and CPU time of the gradient of a long segment, of which a training keeps every state or
every 25th (`Recipe.keep_every`) and computes those between anew.

One epoch of water from its trained laws, with the entire run as its only segment, in a process of
its own for each measurement. The bounds are aims that were set when 0.87 GB were known of a
training: 1 GB, and 1.35 times the time of keeping all states, at 1000 points and 1000 steps.
"""

import json
import subprocess
import sys
from importlib.util import find_spec
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..common.registry import experiment
from ..common.source_digest import ROOT

if TYPE_CHECKING:       # runs in other processes; its source counts as that of the records
    from ..training import epoch_cost  # noqa: F401

MODULE = "validation.training.epoch_cost"
ALL, FEW = 1, 25        # `keep_every` [steps]
MOST_GB = 1.0           # at FULL steps, and in proportion at fewer
MOST_TIME = 1.35        # over that of keeping all states
MOST_CHANGE = 1e-5      # of loss and gradients, relative: they differ by round-off
FULL = 1000             # steps
POINTS = 1000
SCATTER = 0.2           # of memory, between machines
MISSING = ("not run: PyTorch is not installed; `make learn` installs it in the repository's own "
           "environment")


class EpochCost(NamedTuple):
    """The cost of an epoch, its loss and its gradients."""

    cpu: float          # [s]
    process: float      # largest resident memory of the process [GB]
    before: float       # resident memory before the epoch [GB]
    during: float       # largest in the epoch [GB]
    loss: float
    gradients: tuple    # norms, of the elastic and the plastic law

    @property
    def memory(self):
        """Memory of the epoch alone [GB]."""
        return self.during - self.before


COLUMNS = ("keep_every", "repeat", "cpu", "process", "before", "during", "loss", "elastic",
           "plastic")


@experiment("nclaw.segments", title="NCLaw: memory and time of the gradient of a long segment",
            profiles=("quick", "standard"), budget={"quick": 40, "standard": 200})
def segments(run):
    """Measure epochs that keep few states and all states, in turn."""
    if find_spec("torch") is None:
        run.note(MISSING)
        return
    steps, repeats = run.choose(quick=(200, 1), standard=(FULL, 3))
    if steps == FULL:
        measured(FEW, FEW)      # compiles for all processes that follow, whose memory is judged
    turns = [{keep: measured(keep, steps) for keep in (FEW, ALL)}
             for _ in run.progress(range(repeats), "repeats")]
    costs = {keep: [turn[keep] for turn in turns] for keep in (FEW, ALL)}
    record_memory(run, costs, steps)
    record_time(run, costs, steps)
    record_change(run, costs, steps)
    run.table("epochs", COLUMNS, [(keep, k, *one[:5], *one.gradients)
                                  for keep, own in costs.items() for k, one in enumerate(own)])


def measured(keep_every, steps):
    """Return the `EpochCost` of an epoch of `steps` steps in a new process. Raises RuntimeError
    with the last line of its errors where it fails.
    """
    done = subprocess.run([sys.executable, "-m", MODULE, str(keep_every), str(steps)], cwd=ROOT,
                          capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(f"{MODULE} {keep_every} {steps} failed: "
                           f"{(done.stderr.strip().splitlines() or ['no message'])[-1]}")
    found = json.loads(done.stdout.splitlines()[-1])
    sizes = (found[name] / 1e9 for name in ("process", "before", "during"))
    return EpochCost(found["cpu"], *sizes, found["loss"], tuple(found["gradients"]))


def record_memory(run, costs, steps):
    """Record the memory of {keep_every: `EpochCost`s}, of the epoch and of the process."""
    rule = {"unit": "GB", "scale": scale_of(steps), "scatter": SCATTER}
    few, everything = (largest(costs[keep], "memory") for keep in (FEW, ALL))
    process, whole = (largest(costs[keep], "process") for keep in (FEW, ALL))
    run.record("nclaw.segments.memory", few, comparator="<=", bound=MOST_GB * steps / FULL, **rule,
               note=f"of the epoch, beside {everything:.3g} GB with all states kept: largest "
                    "resident memory in it, less that before")
    run.record("nclaw.segments.process", process, **rule,
               **full_rule(steps, MOST_GB),
               note="of the entire process with libraries and the observed run, beside "
                    f"{whole:.3g} GB with all states kept")
    run.record("nclaw.segments.saved", everything / few, unit="1", scatter=SCATTER,
               scale=scale_of(steps), comparator="info",
               note="memory of an epoch that keeps all states over that of one that keeps few")


def largest(costs, name):
    """Return the largest value of a quantity of `EpochCost`s."""
    return max(getattr(one, name) for one in costs)


def record_time(run, costs, steps):
    """Record the CPU time of {keep_every: `EpochCost`s}, and its ratio, judged at the full size."""
    times = [[one.cpu for one in costs[keep]] for keep in (FEW, ALL)]
    few, everything = (float(np.median(each)) for each in times)
    text = f"median of {len(times[0])} in turn, one thread"
    run.record("nclaw.segments.time", few / everything, unit="x", scale=scale_of(steps),
               **full_rule(steps, MOST_TIME),
               note=f"CPU time of an epoch, over that with all states kept; {text}")
    for word, value in (("few", few), ("all", everything)):
        run.record(f"nclaw.segments.cpu.{word}", value, unit="s", scale=scale_of(steps),
                   comparator="info", note=f"CPU time of an epoch; {text}")


def record_change(run, costs, steps):
    """Record the largest relative change of loss and gradients of {keep_every: `EpochCost`s}."""
    few, everything = (np.array([costs[keep][0].loss, *costs[keep][0].gradients])
                       for keep in (FEW, ALL))
    run.record("nclaw.segments.change", np.max(np.abs(few / everything - 1.0)), comparator="<=",
               bound=MOST_CHANGE, scale=scale_of(steps), scatter=1.0,
               note="largest relative change of the loss and of the norms of both gradients, from "
                    "all states kept to few")


def full_rule(steps, most):
    """Return the rule of a record that is judged at the full size alone, by its largest value."""
    return {"comparator": "<=", "bound": most} if steps == FULL else {"comparator": "info"}


def scale_of(steps):
    """Describe the size in words."""
    return f"{POINTS} points, {steps} steps in one segment, every {FEW}th state kept"
