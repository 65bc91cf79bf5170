"""Trains the small laws of NCLaw's trades, for `validation.training.nclaw`. They have no
checkpoints: a training that is cut off begins anew.
"""

from dataclasses import asdict
from pathlib import Path
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

from ..common.provenance import commit, provenance
from ..common.scenes import threads_for, with_
from ..nclaw.bundle import Bundle
from ..nclaw.observation import observed_by
from ..nclaw.small_trainings import identity

ROOT = Path(__file__).parents[2]
BATCH = 40          # segments side by side: all of the first epoch


def run_of(net):
    """`Observed` of the run that a `Small` learns from, all steps."""
    problem = build(with_(net.scene, every=1))
    with threads_for(problem.bodies):
        return observed(problem)


def shown(net, true):
    """Return what a training is given of a run: its `Observed`, and a `Trajectory` of it, or a
    `PartialTrajectory`.
    """
    if net.seen.all:
        return true, trajectory_of(true)
    found, weight = observed_by(net.seen, true, net.scene.dt, net.seed)
    return found, PartialTrajectory(*trajectory_of(found), torch.from_numpy(weight))


def begun(net):
    """`rollout.LawPair` before training, drawn as those of NCLaw but for their width."""
    torch.manual_seed(net.seed)
    return LawPair(*(NeuralLawModule(kind, hidden=(net.width,) * 2)
                     for kind in (Stress(), Correction())))


class Keeper:
    """Keeps laws of a training under way, with what strains they have met, errors and CPU seconds
    of epochs, and shows it on a bar.

    of: (`Small`, `Recipe`, `rollout.LawPair`, what `shown` gives)
    """

    def __init__(self, of, bar):
        self.of, self.bar, self.laws = of, bar, {}
        self.errors, self.cpu, self.since = [], [], process_time()

    def show(self, history):
        """After an epoch."""
        net, epoch, last = self.of[0], len(history), history[-1]
        self.errors.append(last.error)
        self.cpu.append(round(process_time() - self.since, 3))
        self.bar.update()
        self.bar.set_postfix(error=f"{last.error:.1e}", segments=last.segments)
        if epoch in (*net.kept, net.epochs):
            self.laws[epoch] = self.stored(epoch)
        self.since = process_time()

    def stored(self, epoch):
        """`LearnedLaws` as they are."""
        net, recipe, laws, (seen, data) = self.of
        made = weights.LearnedLaws(*(law.weights() for law in laws), {})
        cuts = data.restarts(segment_cuts(recipe, len(seen.x) - 1, epoch))
        bounds = training_bounds(build(net.taken), seen, body_maker(made), cuts)
        return made._replace(about={"seen": bounds, "dt": net.scene.dt})


def bundled(name, net, threads):
    """`Bundle` of a `Small` by name, with what is to be known of it; of a training that diverges,
    as far as it came.
    """
    recipe = Recipe(epochs=net.epochs, first=net.first, last=net.last, seed=net.seed, batch=BATCH)
    laws, given, stopped = begun(net), shown(net, run_of(net)), ""
    with tqdm(total=recipe.epochs, desc=name) as bar:
        keeper = Keeper((net, recipe, laws, given), bar)
        try:
            train(recipe, laws, make_world(build(net.taken)), given[1], None, keeper.show)
        except Diverged as fault:
            stopped = str(fault)
    return Bundle(keeper.laws, {
        **identity(net), "recipe": asdict(recipe), "threads": threads,
        "command": f"python -m validation.training.nclaw {name}", "torch": torch.__version__,
        "errors": keeper.errors, "cpu_seconds": keeper.cpu, "stopped": stopped,
        **provenance(commit(ROOT))})
