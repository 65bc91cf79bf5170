"""`python -m validation.training.epoch_cost KEEP_EVERY STEPS`: memory and CPU time of one epoch of
water whose only segment has so many steps, as a line of JSON. For `nclaw.segments`, which runs it
in a process of its own, since the largest memory of a process never falls. It needs PyTorch.
"""

import ctypes
import json
from contextlib import suppress
from pathlib import Path
from time import process_time

import torch
import typer

from mpm_ref.nclaw.batched_step import make_world
from mpm_ref.nclaw.train.fit import TrajectorySession
from mpm_ref.nclaw.train.observations import trajectory_of
from mpm_ref.nclaw.train.recipe import Recipe
from mpm_ref.nclaw.train.train import continued_laws
from mpm_ref.scene import build
from mpm_ref.store.manifest import peak_memory
from mpm_ref.trajectories import observed

from ..common.scenes import threads_for
from ..nclaw.environments import environment
from ..nclaw.trained_laws import trained

NAME = "water"      # environment, and its trained laws
WARM = 4            # steps of an epoch before, which compiles


def session_of(keep_every, steps):
    """Return the `TrajectorySession` of one epoch from the trained laws of water, whose only
    segment is the observed run of so many steps.
    """
    problem = build(environment(NAME, steps=steps, every=1))
    recipe = Recipe(epochs=1, first=steps, last=steps, keep_every=keep_every)
    return TrajectorySession(recipe, continued_laws("ours", trained(NAME)), make_world(problem),
                             trajectory_of(observed(problem)))


def epoch_cost(session):
    """Run an epoch of a `TrajectorySession`; return its CPU seconds, the largest resident memory of
    the process [bytes], that before the epoch and in it, the loss, and the norms of the gradients.
    """
    earlier = peak_memory()
    begin_peak()
    before, start = peak_memory(), process_time()
    session.epoch()
    cpu, during, epoch = process_time() - start, peak_memory(), session.history[-1]
    return {"cpu": cpu, "process": max(earlier, during), "before": before, "during": during,
            "loss": epoch.loss, "gradients": epoch.steepness}


def begin_peak():
    """Return freed memory to the system, and let the largest resident memory begin anew from the
    present one (malloc_trim(3), proc(5)). Where a system cannot, memory of an epoch is what exceeds
    the earlier peak.
    """
    with suppress(OSError, TypeError, AttributeError):
        ctypes.CDLL(None).malloc_trim(0)
        Path("/proc/self/clear_refs").write_text("5", encoding="ascii")


def main(keep_every: int, steps: int):
    """Print the cost of an epoch, on one thread."""
    torch.set_num_threads(1)
    with threads_for(build(environment(NAME)).bodies):
        session_of(keep_every, WARM).epoch()
        typer.echo(json.dumps(epoch_cost(session_of(keep_every, steps))))


if __name__ == "__main__":
    typer.run(main)
