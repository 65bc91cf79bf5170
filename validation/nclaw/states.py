"""What NCLaw's state figures show: the four training runs, and laws beside the truth away from
them.
"""

import numpy as np

from mpm_ref.scene import build

from ..ldm.kept_bodies import keep
from ..registry import experiment
from ..verification.scenes import threads_for, with_
from .environments import ENVIRONMENTS
from .evaluate import Broken, learned, own, positions
from .nets import trained
from .tasks import SEEDS, reconstruction, time, velocity
from .untrained import untrained

SHOTS = (0, 250, 500, 750, 1000)        # steps, of Figure 6


@experiment("nclaw.fig6", title="NCLaw: the four training runs",
            profiles=("quick", "standard"), budget={"quick": 10, "standard": 10})
def training(run):
    """Keeps the points of each environment at five times."""
    scenes = {name: with_(reconstruction(name), every=SHOTS[1]) for name in ENVIRONMENTS}
    found = {name: shots(scene, own) for name, scene in run.progress(scenes.items(), "runs")}
    keep(run, t=[k * scenes["jelly"].dt for k in SHOTS], **found)
    for name, x in found.items():
        run.record(f"nclaw.fig6.{name}.low", x[-1, :, 1].min(), unit="m", comparator="info",
                   scale=f"{x.shape[1]} particles, {SHOTS[-1]} steps",
                   note="lowest point at the end; the floor is at 0.1 m")


@experiment("nclaw.fig2", title="NCLaw: laws beside the truth, for longer and thrown otherwise",
            profiles=("standard",), budget={"standard": 120})
def away(run):
    """Keeps the points of each environment at the end of tasks (a) and (b): true, ours, ours before
    training.
    """
    beside, found = {"ours": trained, "init": lambda name: untrained()}, {}
    for name in run.progress(ENVIRONMENTS, "environments"):
        for task, scene in (("time", time(name)), ("velocity", velocity(name, SEEDS[0]))):
            at_end = with_(scene, every=scene.steps)
            ends = {"true": shots(at_end, own)[-1]}
            ends |= {word: shots(at_end, learned(laws(name)))[-1]
                     for word, laws in beside.items()}
            record(run, f"nclaw.fig2.{name}.{task}", ends, scene.steps)
            found |= {f"{name}_{task}_{word}": x for word, x in ends.items()}
    keep(run, **found)


def shots(scene, law):
    """Positions (k, n, 3) of a scene's frames with a law; NaN from where it breaks down on."""
    problem, found = build(scene), []
    with threads_for(problem.bodies):
        try:
            found += positions(problem, tuple(map(law, problem.bodies)))
        except Broken:
            missing = 1 + scene.steps // scene.every - len(found)
            found += missing * [np.full_like(found[0], np.nan)]
    return np.array(found)


def record(run, target, ends, steps):
    """Record how far from the truth runs end."""
    for word in ("ours", "init"):
        off = np.mean((ends[word] - ends["true"]) ** 2)
        run.record(f"{target}.{word}", off, unit="m^2", comparator="info",
                   scale=f"{len(ends['true'])} particles, {steps} steps",
                   note="mean squared distance of the last states alone")
