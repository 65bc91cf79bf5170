"""What the trainings of the experiments have in common: which to make, where they go."""

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


def train_all(names, known, places, threads, make):
    """Call make(name, folder, checkpoints) for the names, or for all that are known; places are
    those two folders. The checkpoint NAME.pt goes when it is done.
    """
    for name in names or known:
        if name not in known:
            raise typer.BadParameter(f"{name!r}: expected one of {', '.join(known)}")
    torch.set_num_threads(threads)
    for place in places:
        place.mkdir(parents=True, exist_ok=True)
    for name in names or known:
        make(name, *places)
        (places[1] / f"{name}.pt").unlink(missing_ok=True)
