"""`python -m validation.training.nclaw NAME...`: train the laws of NCLaw's experiments again, the
graph networks that they are compared with, the small laws of trades and those of the filmed dough.

It needs PyTorch. A training that is cut off goes on from its checkpoint.
"""

from dataclasses import asdict
from pathlib import Path

import torch
import typer
from tqdm import tqdm

from mpm_ref.materials.learned import weights
from mpm_ref.materials.learned.table import KINDS
from mpm_ref.nclaw.gnn import weights as of_graphs
from mpm_ref.nclaw.train import train
from mpm_ref.nclaw.train.recipe import Recipe
from mpm_ref.nclaw.train.train import SYS_ID
from mpm_ref.scene import build

from ..common.provenance import commit, provenance
from ..nclaw import bundle, diverged
from ..nclaw.dough import DoughNet, doughs
from ..nclaw.environments import environment, trajectory
from ..nclaw.simulators import GraphNet
from ..nclaw.small_trainings import Small, small_nets
from ..nclaw.strain_bounds import bounds
from ..nclaw.trained_laws import FOLDER, identity, nets
from .common import KEPT, Checkpoints, Folder, Names, Threads, train_all
from .dough import filmed_laws
from .gnn import simulator
from .small import bundled

ROOT = Path(__file__).parents[2]


def begun(net):
    """`Laws` of a net before training."""
    kinds = () if net.method == SYS_ID else (
        KINDS[net.elastic](), KINDS[net.plastic]())
    material = environment(net.environment).body[0].material
    return train.initial_laws(net.method, net.seed, kinds, material)


def taught(net, recipe, laws, checkpoint, show):
    """`laws` trained as the method of a net asks for; returns the session."""
    seen = build(environment(net.environment)), trajectory(net.environment)
    return train.train_laws(net.method, recipe, laws, seen, checkpoint, show)


def made(name, checkpoints, threads):
    """`LearnedLaws` of a net by name, with what is to be known of them; of a training that
    diverges, that alone: plain values.
    """
    net, path = nets()[name], checkpoints / f"{name}.pt"
    recipe = Recipe(epochs=net.epochs, elastic_rate=net.elastic_rate, reading=net.reading,
                    plastic_rate=net.plastic_rate, seed=net.seed, velocity=net.velocity)
    laws, errors, steps = begun(net), [], environment(net.environment).steps
    with tqdm(total=recipe.epochs, desc=name) as bar:
        def show(history):
            errors[:] = [epoch.error for epoch in history]
            bar.update(len(history) - bar.n)
            now = history[-1]
            bar.set_postfix(loss=f"{now.loss:.1e}", error=f"{now.error:.1e}",
                            horizon=round(steps / now.segments))
        try:
            done = taught(net, recipe, laws, path, show)
        except train.Diverged as fault:
            if path.exists() and not errors:    # it went on from there: errors before are not known
                path.unlink()
                return made(name, checkpoints, threads)
            return {**known_of(name, recipe, threads), "errors": errors, "stopped": str(fault)}
    took = {f"{clock}_seconds": round(s, 1) for clock, s in done.meter.total._asdict().items()}
    about = {**known_of(name, recipe, threads), **took, **done.errors}
    stored = train.learned_laws(laws, about)
    return stored._replace(about={**about, "seen": bounds(net, stored),
                                  "dt": environment(net.environment).dt})


def known_of(name, recipe, threads):
    """What is to be known of any training: plain values."""
    return {**identity(nets()[name]), "recipe": asdict(recipe), "threads": threads,
            "command": f"python -m validation.training.nclaw {name}", "torch": torch.__version__,
            **provenance(commit(ROOT))}


def written(path, found):
    """Write what `made` found: weights, or beside them how far a training came."""
    if isinstance(found, weights.LearnedLaws):
        weights.save(path, found)
        diverged.beside(path).unlink(missing_ok=True)
    else:
        kept = diverged.keep(path, found)
        typer.echo(f"{path.stem} diverged: {found['stopped']}\nits errors: {kept}", err=True)


def main(names: Names = None, folder: Folder = FOLDER, checkpoints: Checkpoints = KEPT,
         threads: Threads = 1):
    """Train laws and graph networks and write their weights; of trainings that diverge, errors."""
    def make(name, folder, checkpoints):
        path, net = folder / f"{name}.npz", known[name]
        if isinstance(net, GraphNet):
            of_graphs.save(path, simulator(name, net, checkpoints / f"{name}.pt", threads))
        elif isinstance(net, Small):
            bundle.save(path, bundled(name, net, threads))
        elif isinstance(net, DoughNet):
            written(path, filmed_laws(name, net, checkpoints / f"{name}.pt", threads))
        else:
            written(path, made(name, checkpoints, threads))

    known = {**nets(), **small_nets(), **doughs()}
    train_all(names, known, (folder, checkpoints), threads, make)


if __name__ == "__main__":
    typer.run(main)
