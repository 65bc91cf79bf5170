"""Trains the laws of NCLaw's dough on its film, for `validation.training.nclaw`."""

from dataclasses import asdict
from pathlib import Path

import torch
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

from ..common.provenance import commit, provenance
from ..common.scenes import threads_for, with_
from ..nclaw.dough import EVERY, GUESS, block, camera, film, identity, material, scene

ROOT = Path(__file__).parents[2]
WHOLE = 1.7         # horizon after the last epoch, in runs: the whole run is seen from half-way on
LABELS = {"elastic_rate": 0.1, "plastic_rate": 0.1}


def run_of(of=None):
    """A `Problem` of the block, of a material, at its start, and `Observed` of its run."""
    told = with_(scene(block(), of), every=1)
    with threads_for(build(told).bodies):
        return build(told), observed(build(told))


def seen():
    """`World` and `Film` of the run: what a training is told."""
    problem, true = run_of()
    marks = film(true.x[::EVERY])
    return make_world(problem), observe_images(marks, camera(), problem.bodies[0], EVERY)


def begun(net):
    """`rollout.LawPair` before training on the film."""
    kinds = KINDS[net.elastic](), KINDS[net.plastic]()
    laws = drawn_laws(net.method, net.seed, *kinds)
    if net.guessed:
        problem, run = run_of(material(**GUESS))
        where = make_world(problem)
        labels = labels_of(trajectory_of(run), problem.bodies[0].law, where.dt)
        train_labeled(Recipe(epochs=net.guessed, seed=net.seed, **LABELS), laws, where, labels)
    return laws


def recipe_of(net, steps):
    """`Recipe` of a `DoughNet` for a run of so many steps."""
    return Recipe(epochs=net.epochs, elastic_rate=net.elastic_rate, plastic_rate=net.plastic_rate,
                  first=net.horizon, last=round(WHOLE * steps), reading=PRINTED, seed=net.seed,
                  velocity=net.depth)


def filmed_laws(name, net, checkpoint, threads):
    """`LearnedLaws` of a `DoughNet` by name, with what is to be known of them; of a
    training that diverges, that alone: plain values.
    """
    where, film = seen()
    recipe, laws, errors = recipe_of(net, len(film.x) - 1), begun(net), []
    about = {**identity(net), "recipe": asdict(recipe), "threads": threads,
             "command": f"python -m validation.training.nclaw {name}", "torch": torch.__version__,
             **provenance(commit(ROOT))}
    with tqdm(total=recipe.epochs, desc=name) as bar:
        def show(history):
            errors[:] = [epoch.error for epoch in history]
            bar.update(len(history) - bar.n)
            bar.set_postfix(error=f"{history[-1].error:.1e}")
        try:
            done = train(recipe, laws, where, film, checkpoint, show)
        except Diverged as fault:
            if checkpoint.exists() and not errors:      # those before are not known
                checkpoint.unlink()
                return filmed_laws(name, net, checkpoint, threads)
            return {**about, "errors": errors, "stopped": str(fault)}
    took = {f"{clock}_seconds": round(s, 1) for clock, s in done.meter.total._asdict().items()}
    return learned_laws(laws, {**about, **took, **done.errors})
