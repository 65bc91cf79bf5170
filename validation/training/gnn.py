"""Train the graph networks that NCLaw's laws are compared with, for `validation.training.nclaw`."""

from dataclasses import asdict
from math import isfinite
from pathlib import Path

import torch
from tqdm import tqdm

from mpm_ref.nclaw.gnn.train.examples import training_run
from mpm_ref.nclaw.gnn.train.fit import GraphRecipe, train_graph

from ..common.provenance import commit, provenance
from ..nclaw.simulators import scenes_of, shown
from ..nclaw.trained_laws import identity

ROOT = Path(__file__).parents[2]
TOLD = ("steps", "width", "batch", "noise", "first_rate", "last_rate", "seed")


def recipe_of(net):
    """`GraphRecipe` of a `GraphNet`."""
    return GraphRecipe(**{name: getattr(net, name) for name in TOLD})


def simulator(name, net, checkpoint, threads):
    """`nclaw.gnn.Simulator` of a `GraphNet` by name, with what is to be known of it."""
    recipe, seen = recipe_of(net), [shown(scene) for scene in tqdm(scenes_of(net), desc="runs")]
    dt = seen[0].dt
    runs = [training_run(one.x, one.v, dt, one.box) for one in seen]
    with tqdm(total=recipe.steps, desc=name) as bar:
        def show(history):
            bar.update(len(history) * recipe.check - bar.n)
            bar.set_postfix(loss=f"{history[-1].loss:.2f}", error=f"{history[-1].error:.1e}")
        done = train_graph(recipe, runs, dt, checkpoint, show)
    took = {f"{clock}_seconds": round(s, 1) for clock, s in done.meter.total._asdict().items()}
    return done.simulator({
        **identity(net), "recipe": asdict(recipe), "threads": threads, **took,
        "command": f"python -m validation.training.nclaw {name}", "torch": torch.__version__,
        "picked": done.picked, "losses": [one.loss for one in done.history],
        "errors": [one.error if isfinite(one.error) else None for one in done.history],
        **provenance(commit(ROOT))})
