"""Implement `mpm-ref rom studies | generate | train | run | play | evaluate`: reduced models.

A study file names the scene, its parameters and the map (docs/reference/studies.md). `rom_train`
has the commands `generate` and `train`, `rom_info` has `studies`, `rom_play` has `play`.
"""

import sys
from math import isfinite
from pathlib import Path
from typing import Annotated

import typer

from ..rom.study import baselines, dataset, reduce
from ..rom.study.evaluate import (
    REDUCED,
    breakdown_warnings,
    draw,
    evaluate,
    facts,
    lines,
    stress_facts,
    stress_lines,
    total_errors,
)
from ..rom.study.record import particle_bytes, record, recording
from ..rom.study.resume import earlier_part
from ..rom.study.tables import NSF
from ..scene import SceneError
from ..store.atomic import require_place, require_space, size_text
from ..store.running import FINISHED
from ..store.text import counted
from . import rom_info, rom_play, rom_train
from .catalogue import require_other_file
from .errors import UNSTABLE, end, options, writing
from .options import (
    HDF5,
    PICTURES,
    Data,
    Json,
    MapFile,
    Overwrite,
    StudyName,
    examples,
    load_map,
    named,
    on_interrupt,
    open_study,
    parse_assignments,
    require_ending,
    require_free,
)
from .terminal import as_json, passing, tell, warn

LARGE = 1e9         # bytes of a file that are told before it is written
BROKE = "broke down"

app = typer.Typer(no_args_is_help=True, help="Train a reduced model on many runs of a scene, then "
                  "run it with a few numbers instead of particles.",
                  epilog="`mpm-ref rom studies` lists the bundled studies of reduced models; "
                  "docs/reference/studies.md explains how to write one.")
app.command(epilog=examples("rom", "studies"))(rom_info.studies)
app.command("generate", epilog=examples("rom", "generate gravity_small",
                                        "generate torsion --workers 1 --out runs"))(
    rom_train.make_data)
app.command(epilog=examples("rom", "train gravity_small",
                            "train gravity --kind modes --out modes.npz"))(rom_train.train)
app.command(epilog=examples("rom", "play gravity_small", "play gravity --set g=5 --view xz",
                            "play gravity_small --seconds 5 --keys '1 right, 2 up, 4 r'"))(
    rom_play.play)
Set = Annotated[list[str] | None, typer.Option(
    "--set", help="NAME=VALUE for a parameter of the study; repeat it for each one.")]


@app.command(epilog=examples("rom", "run gravity_small --set g=3.3",
                             "run torsion --set v=0.2 --set w=1.5 --out twist.h5"))
def run(
    name: StudyName,
    values: Set = None,
    map_file: MapFile = None,
    out: Annotated[Path | None, typer.Option(
        "--out", "-o", help="Results file (default: STUDY.h5).")] = None,
    points_out: Annotated[int | None, typer.Option(
        help="Number of points in the results (default: as in the study).", min=1)] = None,
    overwrite: Overwrite = False,
    json: Json = False,
):
    """Run the reduced model of a study into a results file.

    `mpm-ref info`, `plot`, `animate` and `export` take the file. Repeat the command to resume an
    interrupted run bit for bit. Exit status: 0 success, 2 bad input, 3 the run broke down, 4 a file
    could not be written, 130 Ctrl-C.
    """
    with open_study(name) as study:
        out = named(out, study, ".h5")
        with options():
            require_other_file(study.path, out)
            require_ending(out, HDF5)
            require_place(out)
            mu = study.parse_parameters(parse_assignments(values or []))
            file, model = load_map(name, study, map_file)
            announce(out, particle_bytes(study, mu, points_out))
            plan = recording(study, model, mu, points_out)
            plan.facts["map_sha256"] = reduce.sha256(file)
            earlier = earlier_part(plan, out, overwrite)
        warn([*study.range_warnings(mu), *plan.warnings, *changed(earlier)])
        outcome = record_run(plan, out, earlier.states, overwrite)
        if json:
            print(as_json(run_facts(plan, out, outcome)))
        if outcome.breakdown:
            end(outcome.breakdown, UNSTABLE)
        clock = plan.problem.clock
        warn(range_warnings(outcome.out_of_bounds, clock.steps + 1, clock.dt))
        if not json:
            print(f"{FINISHED}: {counted(clock.steps, 'step')} of {reduce.kind_of(model)}, r = "
                  f"{model.field.r}, {plan.count} points in {out}")


def announce(out, size):
    """Announce output above 1 GB. Raises `NotWritten` without enough disk space for it."""
    if size > LARGE:
        print(f"mpm-ref: {out}: {size_text(size)} will be written", file=sys.stderr)
    there = out.stat().st_size if out.exists() else 0
    require_space(out, max(size - there, 0))


def record_run(plan, out, earlier, overwrite):
    """Return the `RecordedRun` of a `Recording`, with a progress bar."""
    at, steps = max(len(earlier) - 1, 0), plan.problem.clock.steps
    again = "the same command without --overwrite" if overwrite else "the same command again"

    def show(k):
        nonlocal at
        at = max(at, k)
        bar.update(k - bar.n)

    with (on_interrupt(lambda: f"at step {at} of {steps}; {again} goes on"),
          passing(total=steps, unit="step", desc=str(out)) as bar):
        return record(plan, out, earlier, show)


def run_facts(plan, out, outcome):
    """Return a `Recording` that finished, or broke down, as plain values."""
    clock, lost = plan.problem.clock, outcome.breakdown
    step = lost.step if lost else clock.steps
    how = ({"why": BROKE, "reason": str(lost), "status": UNSTABLE} if lost else
           {"why": FINISHED, "status": 0})
    return how | {
        "out": str(out), "step": step, "t": step * clock.dt, "frames": step + (not lost),
        "points_out": plan.count, "reduced": plan.facts,
        "out_of_bounds": {str(k): check.out_of_bounds for k,
                          check in outcome.out_of_bounds.items()}}


def changed(earlier):
    """Yield the warning about a run whose `EarlierPart` was made by other code."""
    if not earlier.same_code:
        yield ("the run was made in part by another version of the code, or of NumPy, SciPy or "
               "Numba: it goes on, but not bit for bit; --overwrite makes it anew")


def range_warnings(out_of_bounds, states, dt):
    """Yield the warnings about a run with {step: `StateCheck`} out of bounds, of this number of
    states dt [s] apart.
    """
    if 0 in out_of_bounds:
        yield "the map does not give the body at rest: train longer, or another kind"
    if out_of_bounds:
        worst = max(out_of_bounds.values(), key=lambda check: check.beyond)
        yield (f"{len(out_of_bounds)} of {states} states, from t = {min(out_of_bounds) * dt:.6g} s "
               "on, are where the map has learned nothing or cannot follow; at worst "
               f"{worst.message}")


@app.command("evaluate", epilog=examples(
    "rom", "evaluate gravity_small", "evaluate gravity --map modes.npz --json"))
def evaluate_runs(
    name: StudyName,
    map_file: MapFile = None,
    data: Data = None,
    out: Annotated[Path | None, typer.Option(
        "--out", "-o", help="Picture of the errors over time (png, pdf or svg; default: "
        "MAP.errors.png).")] = None,
    overwrite: Overwrite = False,
    json: Json = False,
):
    """Compare reduced runs with full-order runs that were held out from training.

    The position errors, in three measures, stand beside those of the nearest states of the map, a
    lower bound in most cases, of the training run with the nearest parameters, and of the linear
    interpolation between training runs. Exit status: 0 success, 2 bad input, 3 a reduced run broke
    down, 4 a file could not be written, 130 Ctrl-C.
    """
    with open_study(name) as study:
        picture = out or named(map_file, study, ".npz").with_suffix(".errors.png")
        with options():
            require_ending(picture, PICTURES)
            require_free(picture, overwrite)
            require_place(picture)
            if not study.test:
                raise SceneError(f"{study.path}: test = 0: no run is held out to compare with")
            _, model = load_map(name, study, map_file)
            folder = named(data, study, "-data")
            tell(f"reading {counted(len(study.test), 'run')} in {folder}")
            with writing():
                snapshots = dataset.load(study, folder, study.test)
            tell("comparing reduced runs with them")
            runs = passing(unit="run", iterable=evaluate(study, model, snapshots),
                           total=len(study.test))
            found = list(runs)
            tell("comparing training runs with them")
            nearest, interpolated = (list(runs(study, folder, snapshots)) for runs in (
                baselines.nearest_training_runs, baselines.interpolated_training_runs))
        all_runs, has_stress = total_errors(found, snapshots.X), study.tables.model == NSF
        draw(found, study.names, snapshots.dt, picture)
        if json:
            stress = {"stress": stress_facts(found)} if has_stress else {}
            print(as_json({"study": str(study.path), "picture": str(picture),
                           **facts(study, found, all_runs), "nearest_run": baselines.facts(nearest),
                           "interpolated_run": baselines.facts(interpolated), **stress}))
        else:
            stress = stress_lines(found) if has_stress else ()
            print("\n".join([*lines(study, found, all_runs),
                             *baselines.lines(nearest, baselines.NEAREST),
                             *baselines.lines(interpolated, baselines.INTERPOLATED), *stress,
                             str(picture)]))
        warn(breakdown_warnings(study, found))
    raise typer.Exit(0 if isfinite(all_runs[REDUCED].origin) else UNSTABLE)
