"""Implement `mpm-ref law train --seeds N`: trainings that differ in their seed alone."""

from contextlib import ExitStack
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ..executor import open_executor
from ..nclaw.study import training
from ..nclaw.study.seeds import seed_trainings, train_seed, trained_before
from ..store.atomic import require_place
from ..store.text import counted
from .catalogue import require_other_file
from .errors import UNSTABLE, at_start, end, options
from .law_motion import motion
from .options import HDF5, MAPS, on_interrupt, require_ending, require_free, training_error_text
from .terminal import passing


class SeedOptions(NamedTuple):
    """The options of trainings from several seeds."""

    count: int
    out: Path
    data: Path | None
    workers: int
    scheduler: str | None
    overwrite: bool

    def command(self, name):
        """Return the command that repeats the trainings of a study."""
        kept = "" if self.data is None else f" --data {self.data}"
        return f"mpm-ref law train {name} --out {self.out}{kept} --seeds {self.count}"


def train_seeds(study, name, chosen):
    """Train the laws of a study from several seeds; print the errors of each, and their spread.

    Weights that the same trainings have written are kept.
    """
    with options():
        training.trainer()
        require_ending(chosen.out, MAPS)
        data = chosen.data or chosen.out.with_suffix(".run.h5")
        require_ending(data, HDF5)
        trainings = seed_trainings(study, chosen.count, data.resolve(), chosen.out.resolve(),
                                   chosen.command(name))
        for one in trainings:
            require_other_file(study.path, one.out)
            require_place(one.out)
        errors = [trained_before(one) for one in trainings]
        for one, known in zip(trainings, errors, strict=True):
            if known is None:
                require_free(one.out, chosen.overwrite)
        with at_start(study.path):
            motion(study, data)
    missing = [k for k, known in enumerate(errors) if known is None]
    for k, outcome in train_all([trainings[k] for k in missing], chosen):
        errors[missing[k]] = outcome
    print("\n".join(error_lines(study, trainings, errors)))


def train_all(trainings, chosen):
    """Yield (index, `SeedErrors`) of trainings as they end."""
    done = 0
    with ExitStack() as stack:
        with options():
            executor = stack.enter_context(open_executor(chosen.scheduler, chosen.workers))
        stack.enter_context(on_interrupt(
            lambda: f"after {done} of {counted(len(trainings), 'training')}; the same command goes "
            "on"))
        bar = stack.enter_context(passing(total=len(trainings), unit="training",
                                          desc=str(chosen.out)))
        for outcome in executor.run(train_seed, trainings):
            if outcome.error is not None:
                end(f"{trainings[outcome.index].out}: {outcome.error}", UNSTABLE)
            done += 1
            bar.update()
            yield outcome.index, outcome.value


def error_lines(study, trainings, errors):
    """Return the `SeedErrors` of each training, and their median and range, as lines of text."""
    what = training_error_text(study.tables.method)
    lines = [f"{Path(one.out).name}: {what} {known.last:.3g} at last; {run_text(known.run)}"
             for one, known in zip(trainings, errors, strict=True)]
    runs = np.array([np.inf if known.run is None else known.run for known in errors])
    return [*lines, f"{counted(len(runs), 'seed')}: error of a run in the median "
            f"{percent(np.median(runs))}, from {percent(runs.min())} to {percent(runs.max())}"]


def run_text(error):
    """Return the error of a run as text."""
    return ("its run breaks down" if error is None else
            f"its run is off by {percent(error)} of the motion")


def percent(error):
    """Return a relative error in per cent; infinite is a run that breaks down."""
    return f"{100.0 * error:.3g} %" if np.isfinite(error) else "that of a run that breaks down"
