"""Define options shared by commands, load the objects they name, and check output files."""

from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer

from .. import scene
from ..materials.learned import weights
from ..materials.learned.weights import dim_of
from ..nclaw.study.compare import problem_of
from ..nclaw.train.recipe import TeacherForcing
from ..rom.study import reduce
from ..rom.study.generate import one_thread
from ..rom.study.study import load
from ..scene import SceneError
from ..store.atomic import NotWritten
from .catalogue import bundled_scenes, find_scene
from .errors import INTERRUPT, end, exit_on_errors
from .study_kinds import find_reduced_study
from .terminal import warn

Json = Annotated[bool, typer.Option("--json", help="Print JSON.")]
HDF5, MAPS, PICTURES = (".h5", ".hdf5"), (".npz",), (".png", ".pdf", ".svg")
FILES = (*HDF5, *MAPS, *PICTURES, ".toml", ".json")


def require_ending(out, endings):
    """Raise ValueError unless the name of a file to write ends in one of these."""
    if Path(out).suffix.lower() not in endings:
        raise ValueError(f"--out {out}: expected a name that ends in {' or '.join(endings)}")


def require_folder_name(out):
    """Raise ValueError where the name of a folder to write into is that of a file, unless there is
    such a folder.
    """
    ending = Path(out).suffix.lower()
    if ending in FILES and not Path(out).exists():
        raise ValueError(f"--out {out}: expected the name of a folder, but files' names end in "
                         f"{ending}; leave the ending out")


def make_folder(folder):
    """Make a folder for data. Raises NotWritten."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as fault:
        raise NotWritten(f"--out {folder}: this is no folder, and none can be made there "
                         f"({fault.strerror})") from None


def require_free(out, overwrite):
    """Raise ValueError where a file stands that is not to be replaced."""
    if Path(out).exists() and not overwrite:
        raise ValueError(f"{out} exists: add --overwrite to replace it, or name another file")


WeightsFile = Annotated[Path, typer.Argument(metavar="WEIGHTS",
                                             help="File written by `mpm-ref law train`.")]
SceneName = Annotated[str, typer.Argument(metavar="SCENE",
                                          help="A TOML file or the name of a bundled scene.")]
NUMBERS = (".csv",)
OF_ERRORS = {"labeled": "squared error of F"}       # of methods that follow no motion


def load_matching(file, name, steps=None):
    """(`LearnedLaws`, `Problem`) of a file and of a scene that they fit, of so many steps if
    given. Raises ValueError.
    """
    laws, path = weights.load(file), find_scene(name)
    problem = problem_of(scene.load(path), str(path), steps)
    if dim_of(laws) != problem.dim:
        raise SceneError(f"{file}: its laws are for {dim_of(laws)} dimensions, but {path} has "
                         f"dim = {problem.dim}; name another scene")
    return laws, problem


def training_error_text(method):
    """Return the description of the errors of a training's epochs."""
    return OF_ERRORS.get(method, "mean squared error of a step [m^2]")


def horizons(method, recipe, epochs):
    """The longest runs from a restart in the first and the last of some epochs [steps]; none of
    methods that follow no motion, nor where a recipe, plain values, does not say.
    """
    if method in OF_ERRORS or not {"first", "last", "epochs"} <= recipe.keys():
        return ()
    teacher = TeacherForcing(recipe["first"], recipe["last"])
    return tuple(teacher.horizon(k, recipe["epochs"]) for k in (0, epochs - 1))


def learned_law_warnings(problem):
    """The warnings about bodies whose law in the scene is a learned one, which says what it has
    met.
    """
    for name in problem.strain_bounds:
        yield (f"body {name!r} has a learned law in the scene: this compares two learned laws; "
               "name the scene of the true one")


def step_length_warnings(laws, problem):
    """The warning about steps of another length than in training; or none."""
    dt = laws.about.get("dt")
    if dt not in (None, problem.clock.dt):
        yield (f"the laws were trained in steps of {dt:g} s, the scene has dt = "
               f"{problem.clock.dt:g} s: a learned return map acts once a step, so that it may "
               "answer otherwise")


StudyName = Annotated[str, typer.Argument(metavar="STUDY",
                                          help="A TOML file or the name of a bundled study.")]
Data = Annotated[Path | None, typer.Option(
    help="Folder of the training runs (default: STUDY-data in the current folder).")]
MapFile = Annotated[Path | None, typer.Option(
    "--map", help="File of the reduced model (default: STUDY.npz in the current folder).")]
Scheduler = Annotated[str | None, typer.Option(
    metavar="local:N|tcp://HOST:PORT", help="Dask cluster that performs the tasks: N new processes "
    "of this machine, or the workers of a scheduler (docs/howto/many-machines.md).")]
Overwrite = Annotated[bool, typer.Option("--overwrite", help="Replace the file of --out.")]


def examples(group, *commands):
    """Return examples of a group's commands, a line each, for the end of a help text."""
    return "\n\n".join(["Examples:", *(f"mpm-ref {group} {command}" for command in commands)])


def load_study(name):
    """Return the `Study` of a file or of a bundled name. Raises SceneError."""
    return load(find_reduced_study(name), bundled_scenes())


@contextmanager
def open_study(name):
    """Load a study for reduced runs, on one thread; errors end the command."""
    with exit_on_errors(), one_thread():
        yield load_study(name)


@contextmanager
def on_interrupt(say):
    """End the command on Ctrl-C with the message say(): the progress, and how to resume."""
    try:
        yield
    except KeyboardInterrupt:
        end(f"interrupted {say()}", INTERRUPT)


def named(path, study, ending):
    """A path as it is given; else named after the study, here."""
    return path or Path(f"{study.path.stem}{ending}")


def parse_assignments(texts):
    """Return texts NAME=VALUE without blanks, each name once. Raises SceneError."""
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


def load_map(name, study, path):
    """(file, `Model`) of the map of a study by that name: the file given, else the study's own,
    with a warning where that was made otherwise than the study says. Raises ValueError.
    """
    file = named(path, study, ".npz")
    if not file.exists():
        raise SceneError(f"there is no {file}: mpm-ref rom train {name}"
                         + (f" --out {path}" if path else ""))
    model = reduce.load(file, study)
    if path is None:
        warn(map_warnings(file, study.tables.reduced_model, model))
    return file, model


def map_warnings(file, asked, model):
    """The warning about a map of another kind or r than is asked for, or else of other settings; or
    none.
    """
    made, now = model.about["map"], asked.settings
    kind, r = made["kind"], model.field.r
    others = [key for key in now if made.get(key, now[key]) != now[key]]
    if (kind, r) != (asked.kind, asked.r):
        found, wanted = f"{kind}, r = {r}", f"{asked.kind}, r = {asked.r}"
    elif others:
        found, wanted = (", ".join(f"{key} = {of[key]}" for key in others) for of in (made, now))
    else:
        return
    yield (f"{file} is {found}, where the study's [map] says {wanted}: train again with "
           "--overwrite, or name the map with --map")
