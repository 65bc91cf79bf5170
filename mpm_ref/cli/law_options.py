"""What the commands of `mpm-ref law` have in common: their arguments, and what these stand for."""

from pathlib import Path
from typing import Annotated

import typer

from .. import scene
from ..materials.learned import weights
from ..nclaw.bodies import dim_of
from ..nclaw.study.compare import problem_of
from ..nclaw.train.teacher import Teacher
from ..scene import SceneError
from .shipped import find_scene

WeightsFile = Annotated[Path, typer.Argument(metavar="WEIGHTS",
                                             help="File of `mpm-ref law train`.")]
SceneName = Annotated[str, typer.Argument(metavar="SCENE",
                                          help="A TOML file, or the name of a shipped scene.")]
NUMBERS = (".csv",)
OF_ERRORS = {"labeled": "squared error of F"}       # of methods that follow no motion


def fitting(file, name, steps=None):
    """(`weights.Laws`, `Problem`) of a file and of a scene that they fit, of so many steps if
    given. Raises ValueError.
    """
    laws, path = weights.load(file), find_scene(name)
    problem = problem_of(scene.load(path), str(path), steps)
    if dim_of(laws) != problem.dim:
        raise SceneError(f"{file}: its laws are for {dim_of(laws)} dimensions, but {path} has "
                         f"dim = {problem.dim}; name another scene")
    return laws, problem


def of_errors(method):
    """What the errors of a training's epochs are of, in words."""
    return OF_ERRORS.get(method, "mean squared error of a step [m^2]")


def horizons(method, recipe, epochs):
    """The longest runs from a restart in the first and the last of some epochs [steps]; none of
    methods that follow no motion, nor where a recipe, plain values, does not say.
    """
    if method in OF_ERRORS or not {"first", "last", "epochs"} <= recipe.keys():
        return ()
    teacher = Teacher(recipe["first"], recipe["last"])
    return tuple(teacher.horizon(k, recipe["epochs"]) for k in (0, epochs - 1))


def not_true(problem):
    """The warnings about bodies whose law in the scene is a learned one, which says what it has
    met.
    """
    for name in problem.seen:
        yield (f"body {name!r} has a learned law in the scene: this compares two learned laws; "
               "name the scene of the true one")


def other_steps(laws, problem):
    """The warning about steps of another length than in training; or none."""
    dt = laws.about.get("dt")
    if dt not in (None, problem.clock.dt):
        yield (f"the laws were trained in steps of {dt:g} s, the scene has dt = "
               f"{problem.clock.dt:g} s: a learned return map acts once a step, so that it may "
               "answer otherwise")
