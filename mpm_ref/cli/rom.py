"""`mpm-ref rom generate | train | run | evaluate`: reduced models of a scene (see `reduced`).

A study file names the scene, its parameters and the map; docs/reduced.md explains it.
"""

import os
from contextlib import contextmanager
from math import isfinite
from pathlib import Path
from typing import Annotated

import typer

from ..reduced import dataset, maps
from ..reduced.case import case
from ..reduced.evaluate import REDUCED, breakdowns, draw, evaluate, facts, lines, together
from ..reduced.generate import INTERRUPTED, NOT_WRITTEN, SKIPPED, UNSTABLE, generate, one_thread
from ..reduced.model import kind_of, recording, with_kind
from ..reduced.record import Lost, record, require_leave
from ..reduced.study import load
from ..reduced.tables import KEYS, NETWORK
from ..scene import SceneError
from ..store.atomic import NotWritten, not_written, require_place
from ..store.session import FINISHED
from ..store.words import counted
from . import faults
from .faults import end, one_line, options
from .info import as_json
from .look import Machine
from .shipped import find_study, keep_scene, shipped_scenes
from .terminal import passing, warn

STATUS = {UNSTABLE: faults.UNSTABLE, NOT_WRITTEN: faults.NOT_WRITTEN}
PICTURES = (".png", ".pdf", ".svg")

app = typer.Typer(no_args_is_help=True, help="Reduced models of a scene: learn from many runs, "
                  "then run with a few numbers instead of particles.")
StudyName = Annotated[str, typer.Argument(metavar="STUDY", help="A TOML file, or a shipped one.")]
Data = Annotated[Path | None, typer.Option(help="Folder of `generate`, default: STUDY-data.")]
MapFile = Annotated[Path | None, typer.Option("--map", help="Map of `train`, default: STUDY.npz.")]
Overwrite = Annotated[bool, typer.Option("--overwrite", help="Replace the file.")]
Set = Annotated[list[str] | None, typer.Option("--set", help="NAME=VALUE of each parameter.")]


@app.command("generate")
def make_data(
    name: StudyName,
    out: Annotated[Path | None, typer.Option(
        "--out", "-o", help="Folder for the runs, default: STUDY-data.")] = None,
    workers: Annotated[int | None, typer.Option(
        help="Processes of one thread each, default: all cores.", min=1)] = None,
):
    """Make the full-order runs of a study. Finished ones are left as they are, one that was cut
    off goes on from its checkpoint; Ctrl-C whenever you like.
    """
    with one_line():
        study = studied(name)
        folder, count = named(out, study, "-data"), {}
        with options():
            case(study.scene(study.mu[0]))      # refuses what reduced runs do not know
        make_folder(folder)
        with passing(total=len(study.mu), unit="run", desc=str(folder)) as bar:
            for done in generate(study, folder, workers or os.cpu_count() or 1):
                if done.why == INTERRUPTED:
                    raise KeyboardInterrupt
                if not done.well:
                    bar.close()
                    end(done.said, STATUS.get(done.why, faults.BAD_INPUT))
                count[done.why] = count.get(done.why, 0) + 1
                bar.update()
        there = count.get(SKIPPED, 0)
        print(f"{folder}: {counted(len(study.mu), 'run')} of {study.path.stem}, {there} of them "
              f"already there; {len(study.test)} held out")


@app.command()
def train(
    name: StudyName,
    data: Data = None,
    out: Annotated[Path | None, typer.Option(
        "--out", "-o", help="File for the map, default: STUDY.npz.")] = None,
    kind: Annotated[str | None, typer.Option(
        help=f"Of {', '.join(KEYS)}, default: as studied.")] = None,
    threads: Annotated[int, typer.Option(help="Of PyTorch.", min=1)] = 1,
    overwrite: Overwrite = False,
):
    """Make the map of a study from its runs: POD modes, straight or curved, at once; a network by
    training, which needs PyTorch. A training that is cut off goes on from its checkpoint, MAP.pt.
    """
    with one_line():
        with options():
            study = with_kind(studied(name), kind)
            out, data = named(out, study, ".npz"), named(data, study, "-data")
            require_map_place(out, study, overwrite)
            if study.tables.map.kind == NETWORK:
                maps.training()
            snapshots = dataset.load(study, data, study.train)
            about = {"command": f"mpm-ref rom train {name} --data {data} --out {out} "
                                f"--kind {study.tables.map.kind} --threads {threads}"}
            model = fitted(study, snapshots, about, out.with_suffix(".pt"), threads)
            write(out, model)
        out.with_suffix(".pt").unlink(missing_ok=True)
        print(f"{out}: {kind_of(model)}, r = {model.decoder.r}, of "
              f"{counted(len(study.train), 'run')} and {len(snapshots.X)} points")


def fitted(study, snapshots, about, checkpoint, threads):
    """`Model` of a study's kind, with a bar of epochs."""
    if study.tables.map.kind != NETWORK:
        with one_thread():
            return maps.computed(study, snapshots, about)
    with passing(total=study.tables.map.epochs, unit="epoch", desc=study.path.stem) as bar:
        def show(history):
            bar.update(len(history) - bar.n)
            bar.set_postfix_str(f"loss {history[-1][0]:.2e}")
        return maps.learned(study, snapshots, about, checkpoint, show, threads)


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
    `export`. Exit status as of `mpm-ref run`: 0 done, 2 bad input, 3 the run broke down, 4 a file
    could not be written, 130 Ctrl-C; a run that was cut off is made again, with --overwrite.
    """
    with at_work(name) as study:
        out, file = named(out, study, ".h5"), named(map, study, ".npz")
        with options():
            keep_scene(study.path, out)
            mu = study.given(values or [])
            made = recording(study, maps.load(file, study), mu, points_out)
            made.facts["map_sha256"] = maps.sha256(file)
            require_place(out)
            require_leave(out, overwrite)
        warn(study.outside(mu))
        steps = made.problem.clock.steps
        try:
            with passing(total=steps, unit="step", desc=str(out)) as bar:
                out_of_bounds = record(made, out, lambda k: bar.update(k - bar.n))
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


# what the options stand for

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


def make_folder(folder):
    """Make a folder for data. Raises NotWritten."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as fault:
        raise NotWritten(f"--out {folder}: this is no folder, and none can be made there "
                         f"({fault.strerror})") from None


def require_map_place(out, study, overwrite):
    """Raise ValueError or NotWritten where no map is to be written."""
    keep_scene(study.path, out)
    require_place(out)
    if out.suffix != ".npz":
        raise ValueError(f"--out {out}: expected a name that ends in .npz")
    if out.exists() and not overwrite:
        raise ValueError(f"{out} exists: add --overwrite to replace it, or name another file")


def write(out, model):
    """Write a map. Raises NotWritten."""
    try:
        maps.save(out, model)
    except OSError as fault:
        raise not_written(out, fault) from fault
