"""Implement `mpm-ref law train`: train the laws of a study on a run of its scene."""

from dataclasses import asdict
from math import ceil, sqrt
from pathlib import Path
from time import perf_counter
from typing import Annotated

import typer

from ..materials.learned import weights
from ..nclaw.study import training
from ..nclaw.study.study import load
from ..store.atomic import require_place
from ..store.text import counted
from . import provenance
from .catalogue import bundled_scenes, require_other_file
from .errors import UNSTABLE, at_start, end, exit_on_errors, options, writing
from .law_motion import motion
from .law_seeds import SeedOptions, train_seeds
from .options import (
    HDF5,
    MAPS,
    OF_ERRORS,
    Overwrite,
    Scheduler,
    StudyName,
    horizons,
    on_interrupt,
    require_ending,
    require_free,
    training_error_text,
)
from .study_kinds import find_law_study
from .terminal import passing, warn

SAID = 10           # lines about a training where there is no terminal
LEAST_OFF = 1e-6    # [dx] root mean squared error of laws in their first epoch


def train(
    name: StudyName,
    out: Annotated[Path | None, typer.Option(
        "--out", "-o", help="File for the weights, default: as the study says, or STUDY.npz "
                            "here.")] = None,
    data: Annotated[Path | None, typer.Option(
        help="FILE.h5 with the run to learn from, made if it is not there; default: made anew, "
             "not kept.")] = None,
    threads: Annotated[int, typer.Option(help="Threads of PyTorch.", min=1)] = 1,
    seeds: Annotated[int, typer.Option(
        help="Number of trainings, with the study's seed and those after it; each has weights of "
             "its own, WEIGHTS.seed-K.npz.", min=1)] = 1,
    workers: Annotated[int, typer.Option(help="Number of trainings at a time.", min=1)] = 2,
    scheduler: Scheduler = None,
    overwrite: Overwrite = False,
):
    """Train the laws of a study on the motion of its scene (this needs PyTorch).

    An interrupted training resumes from its checkpoint, WEIGHTS.pt. With --seeds several trainings
    run at a time, and their errors are printed with median and range. Exit status: 0 success, 2 bad
    input, 3 the run became unstable or the training diverged, 4 a file could not be written,
    130 Ctrl-C.
    """
    with exit_on_errors():
        with options():
            study = load(find_law_study(name), bundled_scenes())
            out = out or study.file("weights") or Path(f"{study.path.stem}.npz")
            require_start(study, out, seeds)
        if seeds > 1:
            train_seeds(study, name, SeedOptions(seeds, out, data, workers, scheduler, overwrite))
        else:
            train_one(study, name, out, data, threads, overwrite)


def train_one(study, name, out, data, threads, overwrite):
    """Train the laws of a study, and write the weights."""
    with options():
        checkpoint = study.file("checkpoint") or out.with_suffix(".pt")
        require_outputs(study, out, data, overwrite)
        require_checkpoint(checkpoint, study.path, out, data)
        training.trainer()
        with at_start(study.path):
            observation = motion(study, data)
        with writing():
            laws = learned(study, observation, checkpoint, threads=threads,
                           command=command_line(name, out, data, threads))
    with writing():
        weights.save(out, laws)
    checkpoint.unlink(missing_ok=True)
    print(f"{out}: {summary_text(study, observation, laws.about['errors'])}")


def require_start(study, out, seeds):
    """Raise ValueError for a file `start` of a study that no training goes on from, that is the
    file of the weights to write, or with several seeds, which would change nothing.
    """
    start = study.file("start")
    if start is None:
        return
    if seeds > 1:
        raise ValueError(f"--seeds {seeds}: the laws begin as those of start = "
                         f"{study.tables.start!r}, whatever the seed; leave out --seeds")
    if start.resolve() == out.resolve():
        raise ValueError(f"--out {out}: this is the file that the training goes on from; name "
                         "another one")
    training.start_of_training(training.trainer(), study)


def require_outputs(study, out, data, overwrite):
    """Raise ValueError or NotWritten where no weights, or no run, are to be written."""
    require_other_file(study.path, out)
    require_ending(out, MAPS)
    require_place(out)
    require_free(out, overwrite)
    if data is not None:
        if data.suffix.lower() not in HDF5:
            raise ValueError(f"--data {data}: expected a name that ends in {' or '.join(HDF5)}")
        require_place(data)


def require_checkpoint(checkpoint, study, out, data):
    """Raise ValueError or NotWritten where no checkpoint is to be written: it is removed when the
    weights are there.
    """
    require_place(checkpoint)
    others = {"study": study, "weights": out, "run to learn from": data}
    for word, other in others.items():
        if other is not None and checkpoint.resolve() == other.resolve():
            raise ValueError(f"checkpoint {checkpoint}: this is the file of the {word}; name "
                             "another one")


def command_line(name, out, data, threads):
    """Return the command that repeats a training."""
    kept = "" if data is None else f" --data {data}"
    return f"mpm-ref law train {name} --out {out}{kept} --threads {threads}"


def learned(study, observation, checkpoint, **about):
    """Train the laws of a study with progress; the command ends if the training diverges."""
    how = training.trainer()
    try:
        with (on_interrupt(lambda: resume_hint(checkpoint)),
              Epochs(study, len(observation.x) - 1) as now):
            return training.train_study(study, observation, checkpoint, now.show, **about)
    except how.Diverged as fault:
        left = f"; {checkpoint} is of this training: remove it when the study changes"
        end(f"{study.path}: {fault}{left if checkpoint.exists() else ''}", UNSTABLE)


def resume_hint(checkpoint):
    """Return the hint on resuming an interrupted training."""
    if checkpoint.exists():
        return f"before the laws were learned; the same command again goes on from {checkpoint}"
    return "before there was a checkpoint; the same command again begins anew"


class Epochs:
    """A training under way, on a bar of epochs; where there is no terminal, a line now and then. A
    context manager.
    """

    def __init__(self, study, steps):
        self.study, self.steps, self.total = study, steps, study.tables.train.epochs
        self.made, self.began = 0, 0.0

    def __enter__(self):
        self.bar = passing(total=self.total, unit="epoch", desc=self.study.path.stem)
        return self

    def __exit__(self, *_):
        self.bar.close()

    def show(self, history):
        """The last epoch of a history."""
        done, said = len(history), epoch_in_words(self.study, history[-1], self.steps)
        self.made += 1
        if self.made == 1:          # parts before took no time in this one; and kernels compile
            self.bar.initial = self.bar.n = self.bar.last_print_n = done - 1
            self.began = perf_counter()
            if self.study.tables.start is None:
                warn(nothing_to_learn(self.study, history))
        self.bar.set_postfix_str(said, refresh=False)
        self.bar.update()
        if self.bar.disable and (done % ceil(self.total / SAID) == 0 or done == self.total):
            pace = (perf_counter() - self.began) / max(self.made - 1, 1)
            left = f"; {pace * (self.total - done):.0f} s left" if self.made > 1 else ""
            print(f"epoch {done} of {self.total}: {said}{left}", flush=True)


def nothing_to_learn(study, history):
    """The warning about laws that are hardly off before they have learned anything; or none."""
    off = sqrt(history[0].error) / study.scene.dx
    if study.tables.method not in OF_ERRORS and off < LEAST_OFF:
        yield (f"laws that have learned nothing are off by {off:.1e} dx a step: the motion hardly "
               "depends on stress; are points more than a cell apart, or do they never collide?")


def epoch_in_words(study, epoch, steps):
    """Error, loss, and what the epoch was made of."""
    if study.tables.method in OF_ERRORS:
        return f"loss {epoch.loss:.2e}, batches of pairs: {epoch.segments}"
    return (f"error {epoch.error:.2e} m^2, loss {epoch.loss:.2e}, "
            f"{counted(epoch.segments, 'segment')} of {steps / epoch.segments:.0f}")


def summary_text(study, observation, errors):
    """Return the amount of training data, and the errors of the first and last epoch, as text."""
    steps, points, method = len(observation.x) - 1, observation.x.shape[1], study.tables.method
    over = horizons(method, asdict(study.tables.train), len(errors))
    return (f"{method}, {counted(len(errors), 'epoch')} on {counted(steps, 'step')} of "
            f"{counted(points, 'point')}; {training_error_text(method)} "
            f"{provenance.ends(errors, over)}")

