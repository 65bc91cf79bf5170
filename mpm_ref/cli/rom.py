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
from .rom_options import (
    Data,
    MapFile,
    Overwrite,
    StudyName,
    assigned,
    at_work,
    map_of,
    named,
    on_interrupt,
)
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
        out = named(out, study, ".h5")
        with options():
            keep_scene(study.path, out)
            mu = study.given(assigned(values or []))
            file, model = map_of(name, study, map)
            made = recording(study, model, mu, points_out)
            made.facts["map_sha256"] = maps.sha256(file)
            require_place(out)
            before = begun(made, out, overwrite)
        warn([*study.outside(mu), *changed(before)])
        out_of_bounds = recorded(made, out, before.known, overwrite)
        clock = made.problem.clock
        warn(astray(out_of_bounds, clock.steps + 1, clock.dt))
        print(as_json(ran(made, out, out_of_bounds)) if json else
              f"{FINISHED}: {counted(clock.steps, 'step')} of {kind_of(model)}, r = "
              f"{model.decoder.r}, {len(made.field.X)} points in {out}")


def recorded(made, out, known, overwrite):
    """Make a `Recording`, with a bar of steps; {step: `Sight`} of those out of bounds."""
    at, steps = max(len(known) - 1, 0), made.problem.clock.steps
    again = "the same command without --overwrite" if overwrite else "the same command again"

    def show(k):
        nonlocal at
        at = max(at, k)
        bar.update(k - bar.n)

    try:
        with (on_interrupt(lambda: f"at step {at} of {steps}; {again} goes on"),
              passing(total=steps, unit="step", desc=str(out)) as bar):
            return record(made, out, known, show)
    except Lost as fault:
        end(fault, faults.UNSTABLE)


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


def astray(out_of_bounds, states, dt):
    """The warnings about a run with {step: `Sight`} out of bounds, of so many states dt [s] apart;
    or none.
    """
    if 0 in out_of_bounds:
        yield "the map does not give the body at rest: train longer, or another kind"
    if out_of_bounds:
        worst = max(out_of_bounds.values(), key=lambda sight: sight.beyond)
        yield (f"{len(out_of_bounds)} of {states} states, from t = {min(out_of_bounds) * dt:.6g} s "
               f"on, are where the map has learned nothing or cannot follow; at worst {worst.said}")


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
        picture = out or named(map, study, ".npz").with_suffix(".errors.png")
        with options():
            if picture.suffix.lower() not in PICTURES:
                raise ValueError(f"--out {picture}: expected a name that ends in "
                                 f"{' or '.join(PICTURES)}")
            if not study.test:
                raise SceneError(f"{study.path}: test = 0: no run is held out to compare with")
            _, model = map_of(name, study, map)
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
