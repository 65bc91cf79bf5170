"""`python -m validation.training.nclaw NAME...`: train the laws of NCLaw's experiments again, the
graph networks that they are compared with, the small laws of trades and those of the filmed dough.

It needs PyTorch. An interrupted training continues from its checkpoint.
"""

from dataclasses import asdict
from math import isfinite

import typer
from tqdm import tqdm

from mpm_ref.materials.learned import weights
from mpm_ref.materials.learned.table import KINDS
from mpm_ref.nclaw.gnn import weights as gnn_weights
from mpm_ref.nclaw.gnn.train.examples import training_run
from mpm_ref.nclaw.gnn.train.fit import GraphRecipe, train_graph
from mpm_ref.nclaw.train import train
from mpm_ref.nclaw.train.recipe import Recipe
from mpm_ref.nclaw.train.train import SYS_ID
from mpm_ref.scene import build

from ..nclaw import bundle
from ..nclaw.dough import DoughNet, doughs
from ..nclaw.environments import environment, trajectory
from ..nclaw.idempotence import idempotent_nets
from ..nclaw.longer_horizons import longer_nets
from ..nclaw.seeds import seed_nets
from ..nclaw.simulators import GraphNet, framed_run, scenes_of
from ..nclaw.small_trainings import Small, small_nets
from ..nclaw.strain_bounds import bounds
from ..nclaw.trained_laws import (
    FOLDER,
    diverged_path,
    file_digest,
    identity,
    nets,
    store_diverged,
    trained,
)
from .common import CHECKPOINTS, Checkpoints, Folder, Names, Threads, origin, times, train_all
from .dough import filmed_laws
from .small import bundled

LAW_OPTIONS = ("epochs", "elastic_rate", "plastic_rate", "reading", "seed", "velocity", "first",
               "last", "idempotence")
KEEP_ALL, KEEP_EVERY = 200, 25      # longest segments of which all states are kept, and how many of
                                    # longer ones [steps]
GRAPH_OPTIONS = ("steps", "width", "batch", "noise", "first_rate", "last_rate", "seed")


def untrained_laws(net):
    """Return the `Laws` of a `LawNet` before training, or those from which it goes on."""
    if net.start:
        return train.continued_laws(net.method, trained(net.start))
    kinds = () if net.method == SYS_ID else (
        KINDS[net.elastic](), KINDS[net.plastic]())
    material = environment(net.environment).body[0].material
    return train.initial_laws(net.method, net.seed, kinds, material)


def origin_of_start(net):
    """Return the digest of the weights from which a `LawNet` goes on, by its name in the record."""
    return {"start_sha256": file_digest(net.start)} if net.start else {}


def train_net(net, recipe, laws, checkpoint, show):
    """Train `laws` by the method of a net; return the session."""
    run = build(environment(net.environment)), trajectory(net.environment)
    return train.train_laws(net.method, recipe, laws, run, checkpoint, show)


def recipe_of(net):
    """Return the `Recipe` of a `LawNet`; of long segments few states are kept."""
    keep_every = KEEP_EVERY if net.last > KEEP_ALL else 1
    return Recipe(keep_every=keep_every, **{name: getattr(net, name) for name in LAW_OPTIONS})


def trained_laws(name, net, checkpoints, threads):
    """Return the trained `LearnedLaws` of a name and its `LawNet`, with how they were made; of a
    training that diverges, plain values alone.
    """
    path, recipe = checkpoints / f"{name}.pt", recipe_of(net)
    laws, errors, steps = untrained_laws(net), [], environment(net.environment).steps
    about = {**identity(net), **origin_of_start(net), "recipe": asdict(recipe), "threads": threads,
             **origin("nclaw", name)}
    with tqdm(total=recipe.epochs, desc=name) as bar:
        def show(history):
            errors[:] = [epoch.error for epoch in history]
            bar.update(len(history) - bar.n)
            now = history[-1]
            bar.set_postfix(loss=f"{now.loss:.1e}", error=f"{now.error:.1e}",
                            horizon=round(steps / now.segments))
        try:
            done = train_net(net, recipe, laws, path, show)
        except train.Diverged as fault:
            if path.exists() and not errors:    # continued from there: earlier errors are unknown
                path.unlink()
                return trained_laws(name, net, checkpoints, threads)
            return {**about, "errors": errors, "stopped": str(fault)}
    about |= {**times(done.meter), **done.errors}
    learned = train.learned_laws(laws, about)
    return learned._replace(about={**about, "seen": bounds(net, learned),
                                   "dt": environment(net.environment).dt})


def graph_recipe(net):
    """Return the `GraphRecipe` of a `GraphNet`."""
    return GraphRecipe(**{name: getattr(net, name) for name in GRAPH_OPTIONS})


def trained_simulator(name, net, checkpoint, threads):
    """Return the trained `Simulator` of a `GraphNet`, with how it was made."""
    recipe = graph_recipe(net)
    framed = [framed_run(scene) for scene in tqdm(scenes_of(net), desc="runs")]
    dt = framed[0].dt
    runs = [training_run(one.x, one.v, dt, one.box) for one in framed]
    with tqdm(total=recipe.steps, desc=name) as bar:
        def show(history):
            bar.update(len(history) * recipe.check - bar.n)
            bar.set_postfix(loss=f"{history[-1].loss:.2f}", error=f"{history[-1].error:.1e}")
        done = train_graph(recipe, runs, dt, checkpoint, show)
    return done.simulator({
        **identity(net), "recipe": asdict(recipe), "threads": threads, **times(done.meter),
        "picked": done.picked, "losses": [one.loss for one in done.history],
        "errors": [one.error if isfinite(one.error) else None for one in done.history],
        **origin("nclaw", name)})


def write(path, result):
    """Write trained laws; of a training that diverged, its errors in place of the weights."""
    if isinstance(result, weights.LearnedLaws):
        weights.save(path, result)
        diverged_path(path).unlink(missing_ok=True)
    else:
        record = store_diverged(path, result)
        typer.echo(f"{path.stem} diverged: {result['stopped']}\nits errors: {record}", err=True)


def main(names: Names = None, folder: Folder = FOLDER, checkpoints: Checkpoints = CHECKPOINTS,
         threads: Threads = 1):
    """Train laws and graph networks and write their weights; of trainings that diverge, errors."""
    def make(name, folder, checkpoints):
        path, net, checkpoint = folder / f"{name}.npz", all_nets[name], checkpoints / f"{name}.pt"
        if isinstance(net, GraphNet):
            gnn_weights.save(path, trained_simulator(name, net, checkpoint, threads))
        elif isinstance(net, Small):
            bundle.save(path, bundled(name, net, threads))
        elif isinstance(net, DoughNet):
            write(path, filmed_laws(name, net, checkpoint, threads))
        else:
            write(path, trained_laws(name, net, checkpoints, threads))

    all_nets = {**nets(), **seed_nets(), **longer_nets(), **idempotent_nets(), **small_nets(),
                **doughs()}
    train_all(names, all_nets, (folder, checkpoints), threads, make)


if __name__ == "__main__":
    typer.run(main)
