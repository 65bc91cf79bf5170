"""`mpm-ref rom generate | train | run | evaluate`: reduced models of a scene (see `reduced`).

A study file names the scene, its parameters and the map; docs/reduced.md explains it. The first two
commands are in `rom_make`.
"""

from math import isfinite
from pathlib import Path
from typing import Annotated

import typer

from ..reduced import dataset, maps
from ..reduced.begun import begun
from ..reduced.evaluate import REDUCED, breakdowns, draw, evaluate, facts, lines, together
from ..reduced.model import kind_of, recording
from ..reduced.record import Lost, record
from ..scene import SceneError
from ..store.atomic import require_place
from ..store.session import FINISHED
from ..store.words import counted
from . import faults, rom_make
from .faults import end, options
from .info import as_json
from .look import Machine
from .rom_options import Data, MapFile, Overwrite, StudyName, at_work, named
from .shipped import keep_scene
from .terminal import passing, warn

PICTURES = (".png", ".pdf", ".svg")

app = typer.Typer(no_args_is_help=True, help="Reduced models of a scene: learn from many runs, "
                  "then run with a few numbers instead of particles.")
app.command("generate")(rom_make.make_data)
app.command()(rom_make.train)
Set = Annotated[list[str] | None, typer.Option("--set", help="NAME=VALUE of each parameter.")]


@app.command()
def run(
    name: StudyName,
    values: Set = None,
    map: MapFile = None,
    out: Annotated[Path | None, typer.Option(
        "--out", "-o", help="Results file, default: STUDY.h5.")] = None,
    points_out: Annotated[int | None, typer.Option(
        help="Points to show the body at, default: those of the study.", min=1)] = None,
    overwrite: Overwrite = False,
    json: Machine = False,
):
    """Run the reduced model into a results file, for `mpm-ref info`, `plot`, `animate` and
    `export`. A run that was cut off goes on, bit for bit. Exit status as of `mpm-ref run`: 0 done,
    2 bad input, 3 the run broke down, 4 a file could not be written, 130 Ctrl-C.
    """
    with at_work(name) as study:
        out, file = named(out, study, ".h5"), named(map, study, ".npz")
        with options():
            keep_scene(study.path, out)
            mu = study.given(values or [])
            made = recording(study, maps.load(file, study), mu, points_out)
            made.facts["map_sha256"] = maps.sha256(file)
            require_place(out)
            before = begun(made, out, overwrite)
        warn([*study.outside(mu), *changed(before)])
        steps = made.problem.clock.steps
        try:
            with passing(total=steps, unit="step", desc=str(out)) as bar:
                out_of_bounds = record(made, out, before.known, lambda k: bar.update(k - bar.n))
        except Lost as fault:
            end(fault, faults.UNSTABLE)
        warn(astray(out_of_bounds, steps))
        print(as_json(ran(made, out, out_of_bounds)) if json else
              f"{FINISHED}: {counted(steps, 'step')} of {kind_of(made.model)}, r = "
              f"{made.model.decoder.r}, {len(made.field.X)} points in {out}")


def ran(made, out, out_of_bounds):
    """A `Recording` that was made, as plain values."""
    clock = made.problem.clock
    return {"why": FINISHED, "out": str(out), "step": clock.steps, "t": clock.steps * clock.dt,
            "frames": clock.steps + 1, "points_out": len(made.field.X), "reduced": made.facts,
            "out_of_bounds": {str(k): sight.why for k, sight in out_of_bounds.items()}}


def changed(before):
    """The warning about a run that has `Begun` with other code; or none."""
    if not before.same_code:
        yield ("the run was made in part by another version of the code, or of NumPy, SciPy or "
               "Numba: it goes on, but not bit for bit; --overwrite makes it anew")


def astray(out_of_bounds, steps):
    """The warning about a run with {step: `Sight`} out of bounds, of so many steps; or none."""
    if out_of_bounds:
        worst = max(out_of_bounds.values(), key=lambda sight: sight.beyond)
        yield (f"{len(out_of_bounds)} of {steps} steps, from step {min(out_of_bounds)} on, are "
               f"where the map has learned nothing or cannot follow; at worst {worst.said}")


@app.command("evaluate")
def judge(
    name: StudyName,
    map: MapFile = None,
    data: Data = None,
    out: Annotated[Path | None, typer.Option(
        "--out", "-o", help="Picture of the errors over time, default: MAP.errors.png.")] = None,
    json: Machine = False,
):
    """Errors of reduced runs beside the full-order runs that were held out, and of the map's
    nearest states. Exit status 3 where a reduced run broke down, and a sentence why.
    """
    with at_work(name) as study:
        file = named(map, study, ".npz")
        picture = out or file.with_suffix(".errors.png")
        with options():
            if picture.suffix.lower() not in PICTURES:
                raise ValueError(f"--out {picture}: expected a name that ends in "
                                 f"{' or '.join(PICTURES)}")
            if not study.test:
                raise SceneError(f"{study.path}: test = 0: no run is held out to compare with")
            model = maps.load(file, study)
            snapshots = dataset.load(study, named(data, study, "-data"), study.test)
            runs = passing(unit="run", iterable=evaluate(study, model, snapshots),
                           total=len(study.test))
            found = list(runs)
        all_runs = together(found, snapshots.X)
        draw(found, study.names, snapshots.dt, picture)
        if json:
            print(as_json({"study": str(study.path), "picture": str(picture),
                           **facts(study, found, all_runs)}))
        else:
            print("\n".join([*lines(study, found, all_runs), str(picture)]))
        warn(breakdowns(study, found))
    raise typer.Exit(0 if isfinite(all_runs[REDUCED].origin) else faults.UNSTABLE)
