"""Common options of the training commands, and the loop over the trainings."""

from pathlib import Path
from typing import Annotated

import torch
import typer

from mpm_ref.training import DEVICES

Names = Annotated[list[str] | None, typer.Argument(help="of nets; none: all")]
Folder = Annotated[Path, typer.Option(help="where weights go")]
Checkpoints = Annotated[Path, typer.Option(help="what an interrupted training goes on from")]
Threads = Annotated[int, typer.Option(help="of PyTorch")]
Device = Annotated[str, typer.Option(help=f"where networks are trained: {', '.join(DEVICES)}")]
KEPT = Path("results/training")


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
