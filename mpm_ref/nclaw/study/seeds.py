"""Train the laws of a study from several seeds: each training is a task of its own, which differs
from the others in its seed alone.
"""

from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import msgspec

from ...executor import stop_asked
from ...materials.learned import weights
from .study import LawStudy
from .training import identity, read_run, train_study


class SeedTraining(NamedTuple):
    """One training: plain data, for any process that sees the same files."""

    study: LawStudy         # with the seed
    data: str               # results file of the run to learn from
    out: str                # file for the weights
    command: str            # that repeats all trainings

    @property
    def seed(self):
        """Return the seed of the training."""
        return self.study.tables.train.seed

    @property
    def checkpoint(self):
        """Return the path of the training's checkpoint."""
        return Path(self.out).with_suffix(".pt")


def with_seed(study, seed):
    """Return a study with another seed of its training. Raises ValueError for a seed that PyTorch
    does not take.
    """
    recipe = replace(study.tables.train, seed=seed)
    return study._replace(tables=msgspec.structs.replace(study.tables, train=recipe))


def seed_trainings(study, count, data, out, command):
    """Return `SeedTraining`s with the study's seed and those after it, as many as count.

    out: path of weights; those of a seed have it in their name, as in law.seed-3.npz.
    """
    first, out = study.tables.train.seed, Path(out)
    return [SeedTraining(with_seed(study, seed), str(data),
                         str(out.with_name(f"{out.stem}.seed-{seed}{out.suffix}")), command)
            for seed in range(first, first + count)]


def train_seed(one):
    """Train the laws of a `SeedTraining`, write their weights, and return their `SeedErrors`.

    A training that its executor stops goes on from its checkpoint the next time.
    """
    def stop_if_asked(history):
        if stop_asked():
            raise KeyboardInterrupt

    observed = read_run(one.data, one.study.problem())
    laws = train_study(one.study, observed, one.checkpoint, stop_if_asked, threads=1,
                       command=one.command)
    weights.save(one.out, laws)
    one.checkpoint.unlink(missing_ok=True)
    return errors_of(laws)


class SeedErrors(NamedTuple):
    """The errors of one training."""

    last: float             # of the last epoch, as the method has it
    run: float | None       # of a run over its motion; None where it broke down


def errors_of(laws):
    """Return the `SeedErrors` of trained laws."""
    return SeedErrors(laws.about["errors"][-1], laws.about["run_error"])


def trained_before(one):
    """Return the `SeedErrors` of weights that this very training wrote before, or None."""
    if not Path(one.out).exists():
        return None
    laws = weights.load(one.out)
    same = identity(one.study)
    return errors_of(laws) if all(laws.about.get(key) == same[key] for key in same) else None
