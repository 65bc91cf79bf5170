"""What the commands of `mpm-ref rom` have in common: their options, and what these stand for."""

from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer

from ..reduced.generate import one_thread
from ..reduced.study import load
from .faults import one_line
from .shipped import find_study, shipped_scenes

StudyName = Annotated[str, typer.Argument(metavar="STUDY", help="A TOML file, or a shipped one.")]
Data = Annotated[Path | None, typer.Option(help="Folder of `generate`, default: STUDY-data.")]
MapFile = Annotated[Path | None, typer.Option("--map", help="Map of `train`, default: STUDY.npz.")]
Overwrite = Annotated[bool, typer.Option("--overwrite", help="Replace the file.")]


def studied(name):
    """The `Study` of a file or a shipped name."""
    return load(find_study(name), shipped_scenes())


@contextmanager
def at_work(name):
    """The same, while reduced runs of it are made: on one thread, their faults in one line."""
    with one_line(), one_thread():
        yield studied(name)


def named(path, study, ending):
    """A path as it is given; else named after the study, here."""
    return path or Path(f"{study.path.stem}{ending}")
