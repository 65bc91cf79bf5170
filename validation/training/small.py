"""Training of the small laws of NCLaw's trades, for `validation.training.nclaw`. There are no
checkpoints: an interrupted training starts again.
"""

from dataclasses import asdict
from time import process_time

import torch
from tqdm import tqdm

from mpm_ref.materials.learned import weights
from mpm_ref.materials.learned.response import Correction, Stress
from mpm_ref.nclaw.batched_step import make_world
from mpm_ref.nclaw.bodies import body_maker
from mpm_ref.nclaw.train.fit import train
from mpm_ref.nclaw.train.neural_laws import NeuralLawModule
from mpm_ref.nclaw.train.observations import PartialTrajectory, trajectory_of
from mpm_ref.nclaw.train.recipe import Recipe
from mpm_ref.nclaw.train.rollout import LawPair
from mpm_ref.nclaw.train.strains import segment_cuts, training_bounds
from mpm_ref.scene import build
from mpm_ref.training import Diverged
from mpm_ref.trajectories import observed

from ..common.scenes import threads_for, with_
from ..nclaw.bundle import Bundle
from ..nclaw.observation import observe
from ..nclaw.small_trainings import identity
from .common import origin

BATCH = 40          # segments side by side: all of the first epoch


def run_of(net):
    """Return the `Observed` run that a `Small` learns from, with all steps."""
    problem = build(with_(net.scene, every=1))
    with threads_for(problem.bodies):
        return observed(problem)


def training_data(net, true):
    """Return the `Observed` run of a training, and its `Trajectory` or `PartialTrajectory`."""
    if net.observation.complete:
        return true, trajectory_of(true)
    run, weight = observe(net.observation, true, net.scene.dt, net.seed)
    return run, PartialTrajectory(*trajectory_of(run), torch.from_numpy(weight))


def untrained_laws(net):
    """Return the `rollout.LawPair` before training, drawn like those of NCLaw, of another width."""
    torch.manual_seed(net.seed)
    return LawPair(*(NeuralLawModule(kind, hidden=(net.width,) * 2)
                     for kind in (Stress(), Correction())))


class LawRecorder:
    """Records laws of a training under way, with the strains of their training, and the errors and
    CPU seconds of epochs; moves a bar.

    training: (`Small`, `Recipe`, `rollout.LawPair`, result of `training_data`)
    """

    def __init__(self, training, bar):
        self.training, self.bar, self.laws = training, bar, {}
        self.errors, self.cpu, self.since = [], [], process_time()

    def show(self, history):
        """Record an epoch."""
        net, epoch, last = self.training[0], len(history), history[-1]
        self.errors.append(last.error)
        self.cpu.append(round(process_time() - self.since, 3))
        self.bar.update()
        self.bar.set_postfix(error=f"{last.error:.1e}", segments=last.segments)
        if epoch in (*net.checkpoints, net.epochs):
            self.laws[epoch] = self.learned_laws(epoch)
        self.since = process_time()

    def learned_laws(self, epoch):
        """Return the `LearnedLaws` after an epoch."""
        net, recipe, laws, (run, data) = self.training
        learned = weights.LearnedLaws(*(law.weights() for law in laws), {})
        cuts = data.restarts(segment_cuts(recipe, len(run.x) - 1, epoch))
        bounds = training_bounds(build(net.trained_scene), run, body_maker(learned), cuts)
        return learned._replace(about={"seen": bounds, "dt": net.scene.dt})


def bundled(name, net, threads):
    """Return the `Bundle` of a `Small`, with how it was made; of a training that diverges, the laws
    up to there.
    """
    recipe = Recipe(epochs=net.epochs, first=net.first, last=net.last, seed=net.seed, batch=BATCH)
    laws, data, stopped = untrained_laws(net), training_data(net, run_of(net)), ""
    with tqdm(total=recipe.epochs, desc=name) as bar:
        recorder = LawRecorder((net, recipe, laws, data), bar)
        try:
            train(recipe, laws, make_world(build(net.trained_scene)), data[1], None,
                  recorder.show)
        except Diverged as fault:
            stopped = str(fault)
    return Bundle(recorder.laws, {
        **identity(net), "recipe": asdict(recipe), "threads": threads,
        "errors": recorder.errors, "cpu_seconds": recorder.cpu, "stopped": stopped,
        **origin("nclaw", name)})
