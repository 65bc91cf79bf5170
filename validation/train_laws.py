"""`python -m validation.train_laws NAME...`: train the laws of NCLaw's experiments anew.

It needs PyTorch. A training that is cut off goes on from its checkpoint.
"""

from dataclasses import asdict
from pathlib import Path

import torch
import typer
from tqdm import tqdm

from mpm_ref.materials import make_flow, make_law
from mpm_ref.nclaw import weights
from mpm_ref.nclaw.apart import world
from mpm_ref.nclaw.learn import sysid
from mpm_ref.nclaw.learn.fit import train
from mpm_ref.nclaw.learn.labeled import labels_of, train_labeled
from mpm_ref.nclaw.learn.methods import LABELED, SYS_ID, laws_of, trained_of
from mpm_ref.nclaw.learn.recipe import Recipe
from mpm_ref.nclaw.learn.rollout import trajectory_of
from mpm_ref.scene import build

from .nclaw.environments import environment, trajectory
from .nclaw.nets import FOLDER, identity, nets
from .provenance import commit, provenance
from .training import KEPT, Checkpoints, Folder, Names, Threads, train_all

ROOT = Path(__file__).parents[1]


def begun(net):
    """`Laws` of a net before training."""
    elastic, plastic = weights.RECORDS[net.elastic], weights.RECORDS[net.plastic]
    if net.method != SYS_ID:
        return laws_of(net.method, net.seed, elastic(), plastic())
    material = environment(net.environment).body[0].material
    unit = make_law(material.law, E=1.0, nu=material.nu)
    return sysid.known_laws(unit, material.E, begun_flow(material.flow, unit) or plastic())


def begun_flow(flow, law):
    """The flow of a scene with its constant at `sysid.START` of its value, or None."""
    if flow.type == "none":
        return None
    scaled = {name: sysid.START * getattr(flow, name) for name in ("friction_angle", "tau_y")
              if getattr(flow, name) is not None}
    return make_flow(flow.type, law, 3, **scaled, s_min=flow.s_min)


def taught(net, recipe, laws, checkpoint, show):
    """`laws` trained as the method of a net asks for; returns the session."""
    problem = build(environment(net.environment))
    observed, where = trajectory_of(trajectory(net.environment)), world(problem)
    if net.method == LABELED:
        labels = labels_of(observed, problem.bodies[0].law, where.dt)
        return train_labeled(recipe, laws, where, labels, checkpoint, show)
    return train(recipe, laws, where, observed, checkpoint, show)


def made(name, checkpoints, threads):
    """`nclaw.weights.Laws` of a net by name, with what is to be known of them."""
    net = nets()[name]
    recipe = Recipe(epochs=net.epochs, elastic_rate=net.elastic_rate, reading=net.reading,
                    plastic_rate=net.plastic_rate, seed=net.seed, velocity=net.velocity)
    laws = begun(net)
    with tqdm(total=recipe.epochs, desc=name) as bar:
        def show(history):
            bar.update(len(history) - bar.n)
            bar.set_postfix(error=f"{history[-1].error:.1e}", segments=history[-1].segments)
        done = taught(net, recipe, laws, checkpoints / f"{name}.pt", show)
    took = {f"{clock}_seconds": round(s, 1) for clock, s in done.meter.total._asdict().items()}
    about = {**identity(net), "recipe": asdict(recipe), "threads": threads, **took,
             "command": f"python -m validation.train_laws {name}", "torch": torch.__version__,
             "errors": [epoch.error for epoch in done.history], **provenance(commit(ROOT))}
    return weights.Laws(*map(trained_of, laws), about)


def main(names: Names = None, folder: Folder = FOLDER, checkpoints: Checkpoints = KEPT,
         threads: Threads = 1):
    """Train laws and write their weights."""
    def make(name, folder, checkpoints):
        weights.save(folder / f"{name}.npz", made(name, checkpoints, threads))

    train_all(names, nets(), (folder, checkpoints), threads, make)


if __name__ == "__main__":
    typer.run(main)
