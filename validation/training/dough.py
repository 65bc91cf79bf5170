"""Training of the laws of NCLaw's dough on its images, for `validation.training.nclaw`."""

from dataclasses import asdict

from tqdm import tqdm

from mpm_ref.materials.learned.table import KINDS
from mpm_ref.nclaw.batched_step import make_world
from mpm_ref.nclaw.train.fit import train
from mpm_ref.nclaw.train.labeled import labels_of, train_labeled
from mpm_ref.nclaw.train.observations import observe_images, trajectory_of
from mpm_ref.nclaw.train.recipe import PRINTED, Recipe
from mpm_ref.nclaw.train.train import drawn_laws, learned_laws
from mpm_ref.scene import build
from mpm_ref.training import Diverged
from mpm_ref.trajectories import observed

from ..common.scenes import threads_for, with_
from ..nclaw.dough import EVERY, GUESS, block, camera, identity, material, observe, scene
from .common import origin, times

LAST_HORIZON = 1.7  # after the last epoch, in runs: from half-way on it covers the run
LABELS = {"elastic_rate": 0.1, "plastic_rate": 0.1}


def run_of(dough=None):
    """Return the `Problem` of the block, and its `Observed` run; dough: the material."""
    every_step = with_(scene(block(), dough), every=1)
    with threads_for(build(every_step).bodies):
        return build(every_step), observed(build(every_step))


def training_data():
    """Return the `World` and the `Film` of the run, from which laws are trained."""
    problem, true = run_of()
    marks = observe(true.x[::EVERY])
    return make_world(problem), observe_images(marks, camera(), problem.bodies[0], EVERY)


def initial_laws(net):
    """Return the `rollout.LawPair` before training on the images."""
    kinds = KINDS[net.elastic](), KINDS[net.plastic]()
    laws = drawn_laws(net.method, net.seed, *kinds)
    if net.guessed:
        problem, run = run_of(material(**GUESS))
        world = make_world(problem)
        labels = labels_of(trajectory_of(run), problem.bodies[0].law, world.dt)
        train_labeled(Recipe(epochs=net.guessed, seed=net.seed, **LABELS), laws, world, labels)
    return laws


def recipe_of(net, steps):
    """Return the `Recipe` of a `DoughNet` for a run of `steps` steps."""
    return Recipe(epochs=net.epochs, elastic_rate=net.elastic_rate, plastic_rate=net.plastic_rate,
                  first=net.horizon, last=round(LAST_HORIZON * steps), reading=PRINTED,
                  seed=net.seed, velocity=net.depth)


def filmed_laws(name, net, checkpoint, threads):
    """Return the trained `LearnedLaws` of a `DoughNet`, with how they were made; of a training that
    diverges, plain values alone.
    """
    world, film = training_data()
    recipe, laws, errors = recipe_of(net, len(film.x) - 1), initial_laws(net), []
    about = {**identity(net), "recipe": asdict(recipe), "threads": threads, **origin("nclaw", name)}
    with tqdm(total=recipe.epochs, desc=name) as bar:
        def show(history):
            errors[:] = [epoch.error for epoch in history]
            bar.update(len(history) - bar.n)
            bar.set_postfix(error=f"{history[-1].error:.1e}")
        try:
            done = train(recipe, laws, world, film, checkpoint, show)
        except Diverged as fault:
            if checkpoint.exists() and not errors:      # earlier errors are unknown
                checkpoint.unlink()
                return filmed_laws(name, net, checkpoint, threads)
            return {**about, "errors": errors, "stopped": str(fault)}
    return learned_laws(laws, {**about, **times(done.meter), **done.errors})
