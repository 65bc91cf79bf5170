"""Points of the four training runs, and of laws in other runs, for NCLaw's figures of states."""

from typing import NamedTuple

import numpy as np

from mpm_ref.nclaw.gnn.simulator import Simulator
from mpm_ref.scene import build

from ..common.registry import experiment
from ..common.scenes import threads_for, with_
from ..common.weights_needed import load_available
from ..ldm.published_bodies import keep
from .environments import ENVIRONMENTS
from .evaluate import RunBroken, body_maker, copy_body, frames
from .initial_laws import untrained
from .tasks import SEEDS, reconstruction, time, velocity
from .trained_laws import trained, weights_of

SHOTS = (0, 250, 500, 750, 1000)        # steps, of Figure 6
DISTANCE = "mean squared error of an axis, of the last states alone"
BROKEN = "it broke down before: some points have no finite place"
COMPARED = ("ours", "neural", "gnn")    # in Figure 2


class Shots(NamedTuple):
    """The frames of a run."""

    x: np.ndarray           # (frames, n, 3) positions [m], NaN from where it breaks down on
    end: RunBroken | None   # where it does


@experiment("nclaw.fig6", title="NCLaw: the four training runs",
            profiles=("quick", "standard"), budget={"quick": 10, "standard": 10})
def training(run):
    """Keeps the points of each environment at five times."""
    scenes = {name: with_(reconstruction(name), every=SHOTS[1]) for name in ENVIRONMENTS}
    found = {name: shots(scene, copy_body).x
             for name, scene in run.progress(scenes.items(), "runs")}
    keep(run, t=[k * scenes["jelly"].dt for k in SHOTS], **found)
    for name, x in found.items():
        run.record(f"nclaw.fig6.{name}.low", x[-1, :, 1].min(), unit="m", comparator="info",
                   scale=f"{x.shape[1]} particles, {SHOTS[-1]} steps",
                   note="lowest point at the end; the floor is at 0.1 m")


@experiment("nclaw.fig2", title="NCLaw: laws beside the truth, for longer and thrown otherwise",
            profiles=("standard",), budget={"standard": 400})
def away(run):
    """Keeps the points of each environment at the start and at the end of tasks (a) and (b): true,
    ours, baselines as far as they are trained, ours before training.
    """
    names = [weights_of(word, name) for name in ENVIRONMENTS for word in COMPARED]
    laws, points = load_available(run, names, trained), {}
    for name in run.progress(ENVIRONMENTS, "environments"):
        makers = contestants(name, laws)
        for task, scene in (("time", time(name)), ("velocity", velocity(name, SEEDS[0]))):
            runs = {word: ends(scene, law) for word, law in makers.items()}
            last = {word: x[-1] for word, x in runs.items()}
            record(run, f"nclaw.fig2.{name}.{task}", last, scene.steps)
            shown = {"start": runs["true"][0], **last}
            points |= {f"{name}_{task}_{word}": x for word, x in shown.items()}
    keep(run, **points)


def contestants(name, laws):
    """Return {word: argument of `shots`} of an environment, for trainings that have laws."""
    own_nets = {word: laws.get(weights_of(word, name)) for word in COMPARED}
    return {"true": copy_body,
            **{word: one if isinstance(one, Simulator) else body_maker(one)
               for word, one in own_nets.items() if one is not None},
            "init": body_maker(untrained())}


def ends(scene, law):
    """Return positions (2, n, 3) of a scene with a law at the start and at the end; a graph network
    needs all frames in between.
    """
    every = scene.every if isinstance(law, Simulator) else scene.steps
    return shots(with_(scene, every=every), law).x[[0, -1]]


def shots(scene, law):
    """Return the `Shots` of a scene's frames with a law, as of `evaluate.frames`."""
    problem = build(scene)
    with threads_for(problem.bodies):
        return collect(frames(problem, law), 1 + scene.steps // scene.every)


def collect(run, count):
    """Return the `Shots` of a run of so many frames, an iterator over positions (n, 3)."""
    positions, end = [], None
    try:
        positions += run
    except RunBroken as fault:
        end = fault
        positions += (count - len(positions)) * [np.full_like(positions[0], np.nan)]
    return Shots(np.array(positions), end)


def record(run, target, last, steps):
    """Record the distances of last positions (n, 3), by word, from the true ones."""
    for word, x in last.items():
        if word != "true":
            run.record(f"{target}.{word}", np.mean((x - last["true"]) ** 2), unit="m^2",
                       comparator="info", scale=f"{len(x)} particles, {steps} steps",
                       note=DISTANCE if np.isfinite(x).all() else BROKEN)
