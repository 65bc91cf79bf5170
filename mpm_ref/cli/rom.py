"""`mpm-ref rom studies | generate | train | run | evaluate`: reduced models of a scene (see
`rom.study`).

A study file names the scene, its parameters and the map; docs/reference/studies.md explains it.
`rom_train` has the commands `generate` and `train`, `rom_info` has `studies`.
"""

import sys
from math import isfinite
from pathlib import Path
from typing import Annotated

import typer

from ..rom.study import baselines, dataset, reduce
from ..rom.study import nsf_evaluate as nsf
from ..rom.study.evaluate import REDUCED, breakdowns, draw, evaluate, facts, lines, together
from ..rom.study.model import kind_of, recording, to_write
from ..rom.study.record import record
from ..rom.study.resume import begun
from ..rom.study.tables import NSF
from ..scene import SceneError
from ..store.atomic import in_words, require_place, require_space
from ..store.running import FINISHED
from ..store.words import counted
from . import rom_info, rom_train
from .catalogue import keep_scene
from .errors import UNSTABLE, end, options, writing
from .options import (
    HDF5,
    PICTURES,
    Data,
    Json,
    MapFile,
    Overwrite,
    StudyName,
    assigned,
    at_work,
    examples,
    map_of,
    named,
    on_interrupt,
    require_ending,
    require_free,
)
from .terminal import as_json, passing, warn

LARGE = 1e9         # bytes of a file that are told before it is written
BROKE = "broke down"

app = typer.Typer(no_args_is_help=True, help="Reduced models of a scene: learn from many runs, "
                  "then run with a few numbers instead of particles.",
                  epilog="`mpm-ref rom studies` lists the shipped studies; "
                  "docs/reference/studies.md says how to write your own.")
app.command(epilog=examples("studies"))(rom_info.studies)
app.command("generate", epilog=examples(
    "generate gravity_small", "generate torsion --workers 1 --out runs"))(rom_train.make_data)
app.command(epilog=examples("train gravity_small",
                            "train gravity --kind modes --out modes.npz"))(rom_train.train)
Set = Annotated[list[str] | None, typer.Option(
    "--set", help="NAME=VALUE, once for each parameter of the study.")]


@app.command(epilog=examples("run gravity_small --set g=3.3",
                             "run torsion --set v=0.2 --set w=1.5 --out twist.h5"))
def run(
    name: StudyName,
    values: Set = None,
    map: MapFile = None,
    out: Annotated[Path | None, typer.Option(
        "--out", "-o", help="Results file, default: STUDY.h5 here.")] = None,
    points_out: Annotated[int | None, typer.Option(
        help="Points to show the body at, default: those of the study.", min=1)] = None,
    overwrite: Overwrite = False,
    json: Json = False,
):
    """Run the reduced model into a results file.

    `mpm-ref info`, `plot`, `animate` and `export` take the file. A run that was cut off goes on,
    bit for bit, where the same command is given again. Exit status: 0 done, 2 bad input, 3 the run
    broke down, 4 a file could not be written, 130 Ctrl-C.
    """
    with at_work(name) as study:
        out = named(out, study, ".h5")
        with options():
            keep_scene(study.path, out)
            require_ending(out, HDF5)
            require_place(out)
            mu = study.given(assigned(values or []))
            file, model = map_of(name, study, map)
            announce(out, to_write(study, mu, points_out))
            made = recording(study, model, mu, points_out)
            made.facts["map_sha256"] = reduce.sha256(file)
            before = begun(made, out, overwrite)
        warn([*study.outside(mu), *made.doubts, *changed(before)])
        outcome = recorded(made, out, before.known, overwrite)
        if json:
            print(as_json(ran(made, out, outcome)))
        if outcome.lost:
            end(outcome.lost, UNSTABLE)
        clock = made.problem.clock
        warn(astray(outcome.out_of_bounds, clock.steps + 1, clock.dt))
        if not json:
            print(f"{FINISHED}: {counted(clock.steps, 'step')} of {kind_of(model)}, r = "
                  f"{model.field.r}, {made.count} points in {out}")


def announce(out, size):
    """Say how many bytes are to be written, where they are many. Raises NotWritten where the disk
    has not so many, those of the file that they replace included.
    """
    if size > LARGE:
        print(f"mpm-ref: {out}: {in_words(size)} will be written", file=sys.stderr)
    there = out.stat().st_size if out.exists() else 0
    require_space(out, max(size - there, 0))


def recorded(made, out, known, overwrite):
    """Make a `Recording`, with a bar of steps; its `Outcome`."""
    at, steps = max(len(known) - 1, 0), made.problem.clock.steps
    again = "the same command without --overwrite" if overwrite else "the same command again"

    def show(k):
        nonlocal at
        at = max(at, k)
        bar.update(k - bar.n)

    with (on_interrupt(lambda: f"at step {at} of {steps}; {again} goes on"),
          passing(total=steps, unit="step", desc=str(out)) as bar):
        return record(made, out, known, show)


def ran(made, out, outcome):
    """A `Recording` that was made, or broke down, as plain values."""
    clock, lost = made.problem.clock, outcome.lost
    step = lost.step if lost else clock.steps
    how = ({"why": BROKE, "reason": str(lost), "status": UNSTABLE} if lost else
           {"why": FINISHED, "status": 0})
    return how | {
        "out": str(out), "step": step, "t": step * clock.dt, "frames": step + (not lost),
        "points_out": made.count, "reduced": made.facts,
        "out_of_bounds": {str(k): sight.why for k, sight in outcome.out_of_bounds.items()}}


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


@app.command("evaluate", epilog=examples(
    "evaluate gravity_small", "evaluate gravity --map modes.npz --json"))
def judge(
    name: StudyName,
    map: MapFile = None,
    data: Data = None,
    out: Annotated[Path | None, typer.Option(
        "--out", "-o", help="Picture of the errors over time (png, pdf or svg), default: "
        "MAP.errors.png.")] = None,
    overwrite: Overwrite = False,
    json: Json = False,
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
            with writing():
                snapshots = dataset.load(study, folder, study.test)
            inferred = study.tables.model == NSF
            compare = nsf.evaluate if inferred else evaluate
            runs = passing(unit="run", iterable=compare(study, model, snapshots),
                           total=len(study.test))
            found = list(runs)
            trained = list(baselines.nearby(study, folder, snapshots))
        all_runs = together(found, snapshots.X)
        draw(found, study.names, snapshots.dt, picture)
        if json:
            stress = {"stress": nsf.stress_facts(found)} if inferred else {}
            print(as_json({"study": str(study.path), "picture": str(picture),
                           **facts(study, found, all_runs), "nearby": baselines.facts(trained),
                           **stress}))
        else:
            stress = nsf.stress_lines(found) if inferred else ()
            print("\n".join([*lines(study, found, all_runs), *baselines.lines(trained), *stress,
                             str(picture)]))
        warn(breakdowns(study, found))
    raise typer.Exit(0 if isfinite(all_runs[REDUCED].origin) else UNSTABLE)
