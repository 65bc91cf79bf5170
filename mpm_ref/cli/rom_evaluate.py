"""`mpm-ref rom evaluate`: how far reduced runs are off the full-order runs that were held out."""

from math import isfinite
from pathlib import Path
from typing import Annotated

import typer

from ..reduced import dataset, nearby
from ..reduced.evaluate import REDUCED, breakdowns, draw, evaluate, facts, lines, together
from ..reduced.nsf import evaluate as nsf
from ..reduced.tables import NSF
from ..scene import SceneError
from ..store.atomic import require_place
from . import faults
from .faults import options
from .info import as_json
from .look import Machine
from .outputs import PICTURES, require_ending, require_free
from .rom_options import Data, MapFile, Overwrite, StudyName, at_work, map_of, named
from .terminal import passing, warn


def judge(
    name: StudyName,
    map: MapFile = None,
    data: Data = None,
    out: Annotated[Path | None, typer.Option(
        "--out", "-o", help="Picture of the errors over time (png, pdf or svg), default: "
        "MAP.errors.png.")] = None,
    overwrite: Overwrite = False,
    json: Machine = False,
):
    """Compare reduced runs with the full-order runs that were held out.

    Their position errors by three measures, beside those of the map's nearest states, which reduced
    runs on it seldom beat, and of the training run with the nearest parameters, taken as it is.
    Exit status: 0 done, 2 bad input, 3 a reduced run broke down, 4 a file could not be written, 130
    Ctrl-C.
    """
    with at_work(name) as study:
        picture = out or named(map, study, ".npz").with_suffix(".errors.png")
        with options():
            require_ending(picture, PICTURES)
            require_free(picture, overwrite)
            require_place(picture)
            if not study.test:
                raise SceneError(f"{study.path}: test = 0: no run is held out to compare with")
            _, model = map_of(name, study, map)
            folder = named(data, study, "-data")
            with faults.writing():
                snapshots = dataset.load(study, folder, study.test)
            inferred = study.tables.model == NSF
            compare = nsf.evaluate if inferred else evaluate
            runs = passing(unit="run", iterable=compare(study, model, snapshots),
                           total=len(study.test))
            found = list(runs)
            trained = list(nearby.nearby(study, folder, snapshots))
        all_runs = together(found, snapshots.X)
        draw(found, study.names, snapshots.dt, picture)
        if json:
            stress = {"stress": nsf.stress_facts(found)} if inferred else {}
            print(as_json({"study": str(study.path), "picture": str(picture),
                           **facts(study, found, all_runs), "nearby": nearby.facts(trained),
                           **stress}))
        else:
            stress = nsf.stress_lines(found) if inferred else ()
            print("\n".join([*lines(study, found, all_runs), *nearby.lines(trained), *stress,
                             str(picture)]))
        warn(breakdowns(study, found))
    raise typer.Exit(0 if isfinite(all_runs[REDUCED].origin) else faults.UNSTABLE)
