"""Implement `mpm-ref rom generate` and `train`: the data of a study, and its reduced model."""

import os
from collections import Counter
from pathlib import Path
from typing import Annotated

import typer

from ..rom import model_file
from ..rom.study import dataset, reduce
from ..rom.study.distribute import generate_on
from ..rom.study.generate import (
    INTERRUPTED,
    NOT_WRITTEN,
    SKIPPED,
    UNSTABLE,
    file_of,
    generate,
    one_thread,
    parameter_text,
)
from ..rom.study.record import supported_model
from ..rom.study.study import training_hints
from ..rom.study.tables import KEYS, LDM, NETWORK, NSF
from ..store.atomic import require_place
from ..store.text import counted
from ..training import DEVICES, Machine
from . import errors
from .catalogue import require_other_file
from .errors import end, exit_on_errors, options, writing
from .options import (
    MAPS,
    Data,
    Overwrite,
    Scheduler,
    StudyName,
    load_study,
    make_folder,
    named,
    on_interrupt,
    require_ending,
    require_folder_name,
    require_free,
)
from .terminal import announce_compilation_of_workers, passing, tell, warn

MADE, CONTINUED, THERE = "made", "continued", "was there"
STATUS = {UNSTABLE: errors.UNSTABLE, NOT_WRITTEN: errors.NOT_WRITTEN}


def make_data(
    name: StudyName,
    out: Annotated[Path | None, typer.Option(
        "--out", "-o", help="Folder for the runs (default: STUDY-data).")] = None,
    workers: Annotated[int | None, typer.Option(
        help="Number of processes with one thread each (default: all cores).", min=1)] = None,
    scheduler: Scheduler = None,
):
    """Generate the full-order runs of a study.

    Finished runs are skipped, interrupted ones resume from their checkpoints. The workers of a
    scheduler write the runs, so that all machines need the folder under the same path. Exit status:
    0 success, 2 bad input, 3 a run became unstable, 4 a file could not be written, 130 Ctrl-C.
    """
    with exit_on_errors():
        study = load_study(name)
        folder, ended = named(out, study, "-data"), []
        with options():
            require_folder_name(folder)
            require_one(workers, scheduler)
            supported_model(study, study.mu[0])     # refuses what reduced runs do not know
        make_folder(folder)
        workers = workers or os.cpu_count() or 1
        with (on_interrupt(lambda: f"after {len(ended)} of {counted(len(study.mu), 'run')}; the "
                           "same command again goes on"),
              passing(total=len(study.mu), unit="run", desc=str(folder)) as bar):
            if bar.disable:
                place = (f"on workers of {scheduler}" if scheduler else
                         f"{min(workers, len(study.mu))} at a time")
                print(f"{folder}: {counted(len(study.mu), 'run')} of {study.path.stem}, {place}",
                      flush=True)
            announce_compilation_of_workers()
            for done in (generate_on(scheduler, study, folder) if scheduler else
                         generate(study, folder, workers)):
                if done.why == INTERRUPTED:
                    raise KeyboardInterrupt
                if not done.has_data:
                    bar.close()
                    end(done.message, STATUS.get(done.why, errors.BAD_INPUT))
                ended.append(done)
                bar.update()
                if bar.disable:
                    print(f"{len(ended)} of {len(study.mu)}: {file_of(folder, done.number)}, "
                          f"{parameter_text(study, study.mu[done.number])}: {origin_word(done)}",
                          flush=True)
        print(f"{folder}: {counted(len(study.mu), 'run')} of {study.path.stem}: "
              f"{counts_text(ended)}; {len(study.test)} held out")


def require_one(workers, scheduler):
    """Raise ValueError where both a number of processes and a scheduler are given."""
    if workers is not None and scheduler is not None:
        raise ValueError(f"--workers {workers} and --scheduler {scheduler}: give one of the two; "
                         "the scheduler has workers of its own")


def origin_word(done):
    """Return a word on how a `GeneratedRun` that ended well came about."""
    if done.why == SKIPPED:
        return THERE
    return CONTINUED if done.continued else MADE


def counts_text(ended):
    """Return the numbers of runs made, continued and found, as text."""
    count = Counter(map(origin_word, ended))
    made, continued, there = (count[word] for word in (MADE, CONTINUED, THERE))
    return f"made {made}, continued {continued}, {there} were there"


def machine_of(text):
    """`Machine` of what is typed: a number of threads, or a device. Raises ValueError."""
    if text in DEVICES[1:]:
        return Machine(device=text)
    if not text.isdecimal() or int(text) < 1:
        raise ValueError(f"--threads {text}: expected 1 or more, or {DEVICES[1]}")
    return Machine(int(text))


def train(
    name: StudyName,
    data: Data = None,
    out: Annotated[Path | None, typer.Option(
        "--out", "-o", help="File for the reduced model (default: STUDY.npz).")] = None,
    kind: Annotated[str | None, typer.Option(
        help=f"Kind of the map: {', '.join(KEYS)} (default: as in the study).")] = None,
    threads: Annotated[str, typer.Option(
        metavar="N|cuda", help="Threads of PyTorch, or cuda for a graphics processor.")] = "1",
    overwrite: Overwrite = False,
):
    """Train the reduced model of a study on its runs.

    POD modes and polynomial manifolds are computed directly; a network is trained, which needs
    PyTorch. An interrupted training resumes from its checkpoint, MAP.pt. Exit status: 0 success,
    2 bad input, 4 a file could not be written, 130 Ctrl-C.
    """
    with exit_on_errors():
        with options():
            study, machine = load_study(name), machine_of(threads)
            out, data = named(out, study, ".npz"), named(data, study, "-data")
            checkpoint = out.with_suffix(".pt")
            require_map_place(out, study, overwrite)
            study = study.with_kind(kind)
            if study.tables.model == LDM:
                reduce.require_one_body(study)
            require_device(study.tables.reduced_model.kind, machine.device)
            tell(f"reading {counted(len(study.train), 'run')} in {data}")
            with writing():
                snapshots = dataset.load(study, data, study.train)
            if study.tables.model == NSF:
                warn(training_hints(study))
            about = {"command": f"mpm-ref rom train {name} --data {data} --out {out} "
                                f"--kind {study.tables.reduced_model.kind} "
                                f"{threads_option(machine)}"}
            with writing(), on_interrupt(lambda: resume_hint(checkpoint)):
                model = compute_model(study, snapshots, about, checkpoint, machine)
            write(out, model)
        reduce.forget_checkpoint(checkpoint)
        print(f"{out}: {reduce.kind_of(model)}, r = {model.field.r}, of "
              f"{counted(len(study.train), 'run')} and {len(snapshots.X)} points")


def require_device(kind, device):
    """Raise ValueError for a kind of map that does not support a device, or if that is missing."""
    if kind == NETWORK:
        reduce.trainer().device_of(device)
    elif device != DEVICES[0]:
        raise ValueError(f"--threads {device}: {kind} are made on the processor; leave it out")


def threads_option(machine):
    """Return the command-line option that selects a `Machine`."""
    return f"--threads {machine.threads if machine.device == DEVICES[0] else machine.device}"


def resume_hint(checkpoint):
    """Return the hint on resuming an interrupted training."""
    if checkpoint.exists():
        return f"before the map was made; the same command again goes on from {checkpoint}"
    return "before there was a checkpoint; the same command again begins anew"


def compute_model(study, snapshots, about, checkpoint, machine):
    """Return the `Model` of a study's kind, with a progress bar of epochs."""
    if study.tables.reduced_model.kind != NETWORK:
        tell(f"computing {study.tables.reduced_model.kind} of {counted(len(study.train), 'run')}")
        with one_thread():
            return reduce.compute_model(study, snapshots, about)
    with passing(total=study.tables.reduced_model.total, unit="epoch", desc=study.path.stem) as bar:
        def show(history):
            bar.update(len(history) - bar.n)
            bar.set_postfix_str(f"loss {history[-1][0]:.2e}")
        return reduce.train_model(study, snapshots, about, checkpoint, show, machine)


def require_map_place(out, study, overwrite):
    """Raise ValueError or NotWritten where no map is to be written."""
    require_other_file(study.path, out)
    require_ending(out, MAPS)
    require_place(out)
    require_free(out, overwrite)


def write(out, model):
    """Write a map. Raises NotWritten."""
    with writing():
        model_file.save(out, model)
