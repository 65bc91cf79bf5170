"""What the commands of `mpm-ref rom` have in common: their options, and what these stand for."""

from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer

from ..reduced import maps
from ..reduced.generate import one_thread
from ..reduced.study import load
from ..scene import SceneError
from .faults import INTERRUPT, end, one_line
from .shipped import find_study, shipped_scenes
from .terminal import warn

StudyName = Annotated[str, typer.Argument(metavar="STUDY",
                                          help="A TOML file, or the name of a shipped study.")]
Data = Annotated[Path | None, typer.Option(
    help="Folder of `generate`, default: STUDY-data here.")]
MapFile = Annotated[Path | None, typer.Option(
    "--map", help="Map of `train`, default: STUDY.npz here.")]
Overwrite = Annotated[bool, typer.Option("--overwrite", help="Replace the file of --out.")]


def examples(*commands):
    """The end of a command's help: how it is typed, a line each."""
    return "\n\n".join(["Examples:", *(f"mpm-ref rom {command}" for command in commands)])


def studied(name):
    """The `Study` of a file or a shipped name."""
    return load(find_study(name), shipped_scenes())


@contextmanager
def at_work(name):
    """The same, while reduced runs of it are made: on one thread, their faults in one line."""
    with one_line(), one_thread():
        yield studied(name)


@contextmanager
def on_interrupt(say):
    """Ctrl-C in this block ends the command; say() tells how far it is, and how to go on."""
    try:
        yield
    except KeyboardInterrupt:
        end(f"interrupted {say()}", INTERRUPT)


def named(path, study, ending):
    """A path as it is given; else named after the study, here."""
    return path or Path(f"{study.path.stem}{ending}")


def assigned(texts):
    """Texts NAME=VALUE without blanks, each name once. Raises SceneError."""
    found = {}
    for text in texts:
        name, sign, value = (part.strip() for part in text.partition("="))
        if not sign:
            raise SceneError(f"{text}: expected NAME=VALUE")
        if name in found:
            raise SceneError(f"--set {name} is given twice, {found[name]} and {name}={value}: "
                             "keep one of them")
        found[name] = f"{name}={value}"
    return list(found.values())


def map_of(name, study, path):
    """(file, `Model`) of the map of a study by that name: the file given, else the study's own,
    with a warning where that was made otherwise than the study says. Raises ValueError.
    """
    file = named(path, study, ".npz")
    if not file.exists():
        raise SceneError(f"there is no {file}: mpm-ref rom train {name}"
                         + (f" --out {path}" if path else ""))
    model = maps.load(file, study)
    if path is None:
        warn(unlike(file, study.tables.map, model))
    return file, model


def unlike(file, asked, model):
    """The warning about a map of another kind or r than is asked for, or else of other settings; or
    none.
    """
    made, now = model.about["map"], asked.settings
    kind, r = made["kind"], model.decoder.r
    others = [key for key in now if made.get(key, now[key]) != now[key]]
    if (kind, r) != (asked.kind, asked.r):
        found, wanted = f"{kind}, r = {r}", f"{asked.kind}, r = {asked.r}"
    elif others:
        found, wanted = (", ".join(f"{key} = {of[key]}" for key in others) for of in (made, now))
    else:
        return
    yield (f"{file} is {found}, where the study's [map] says {wanted}: train again with "
           "--overwrite, or name the map with --map")
