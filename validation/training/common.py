"""Common parts of the training commands: options, provenance, and the loop over the trainings."""

from pathlib import Path
from typing import Annotated

import torch
import typer

from mpm_ref.training import DEVICES

from ..common.provenance import commit, provenance

Names = Annotated[list[str] | None, typer.Argument(help="of nets; none: all")]
Folder = Annotated[Path, typer.Option(help="where weights go")]
Checkpoints = Annotated[Path, typer.Option(help="where an interrupted training continues from")]
Threads = Annotated[int, typer.Option(help="of PyTorch")]
Device = Annotated[str, typer.Option(help=f"where networks are trained: {', '.join(DEVICES)}")]
CHECKPOINTS = Path("results/training")
ROOT = Path(__file__).parents[2]


def origin(paper, name):
    """Return the plain values on how weights were made: command, versions, commit, date."""
    return {"command": f"python -m validation.training.{paper} {name}", "torch": torch.__version__,
            **provenance(commit(ROOT))}


def times(meter):
    """Return {"wall_seconds": .., "cpu_seconds": ..} of a training, rounded."""
    return {f"{clock}_seconds": round(s, 1) for clock, s in meter.total._asdict().items()}


def train_all(names, trainings, places, threads, make):
    """Call make(name, folder, checkpoints) for the names, or for all `trainings`; places are
    those two folders. The checkpoint NAME.pt goes when it is done.
    """
    for name in names or trainings:
        if name not in trainings:
            raise typer.BadParameter(f"{name!r}: expected one of {', '.join(trainings)}")
    torch.set_num_threads(threads)
    for place in places:
        place.mkdir(parents=True, exist_ok=True)
    for name in names or trainings:
        make(name, *places)
        (places[1] / f"{name}.pt").unlink(missing_ok=True)
