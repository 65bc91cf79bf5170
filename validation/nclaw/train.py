"""`python -m validation.nclaw.train NAME...`: train the laws of NCLaw's experiments anew.

It needs PyTorch. A training that is cut off goes on from its checkpoint.
"""

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import torch
import typer
from tqdm import tqdm

from mpm_ref.nclaw import weights
from mpm_ref.nclaw.apart import world
from mpm_ref.nclaw.learn.fit import train
from mpm_ref.nclaw.learn.law import neural_laws, trained_of
from mpm_ref.nclaw.learn.recipe import Recipe
from mpm_ref.nclaw.learn.rollout import trajectory_of
from mpm_ref.scene import build

from ..provenance import commit, provenance
from .environments import environment, trajectory
from .nets import FOLDER, identity, nets

ROOT = Path(__file__).parents[2]


def made(name, checkpoints, threads):
    """`nclaw.weights.Laws` of a net by name, with what is to be known of them."""
    net = nets()[name]
    recipe = Recipe(epochs=net.epochs, reading=net.reading, seed=net.seed)
    laws = neural_laws(recipe.seed, weights.KINDS[net.elastic](), weights.KINDS[net.plastic]())
    with tqdm(total=recipe.epochs, desc=name) as bar:
        def show(history):
            bar.update(len(history) - bar.n)
            bar.set_postfix(error=f"{history[-1].error:.1e}", segments=history[-1].segments)
        done = train(recipe, laws, world(build(environment(net.environment))),
                     trajectory_of(trajectory(net.environment)), checkpoints / f"{name}.pt", show)
    took = {f"{clock}_seconds": round(s, 1) for clock, s in done.meter.total._asdict().items()}
    about = {**identity(net), "recipe": asdict(recipe), "threads": threads, **took,
             "command": f"python -m validation.nclaw.train {name}", "torch": torch.__version__,
             "errors": [epoch.error for epoch in done.history], **provenance(commit(ROOT))}
    return weights.Laws(*map(trained_of, laws), about)


def main(
    names: Annotated[list[str] | None, typer.Argument(help="of nets; none: all")] = None,
    folder: Annotated[Path, typer.Option(help="where weights go")] = FOLDER,
    checkpoints: Annotated[Path, typer.Option(help="what an interrupted training goes on from")]
    = Path("results/training"),
    threads: Annotated[int, typer.Option(help="of PyTorch")] = 1,
):
    """Train laws and write their weights."""
    known = nets()
    for name in names or known:
        if name not in known:
            raise typer.BadParameter(f"{name!r}: expected one of {', '.join(known)}")
    torch.set_num_threads(threads)
    for place in (folder, checkpoints):
        place.mkdir(parents=True, exist_ok=True)
    for name in names or known:
        weights.save(folder / f"{name}.npz", made(name, checkpoints, threads))
        (checkpoints / f"{name}.pt").unlink()


if __name__ == "__main__":
    typer.run(main)
