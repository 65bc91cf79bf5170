"""Errors of small trainings (see `small_trainings`): on the run that they learned from, with other
velocities, and in the body of the environment itself, of more points on a finer grid.
"""

from math import isnan
from typing import NamedTuple

import numpy as np

from ..common.scenes import with_
from ..common.weights_needed import load_available
from .environments import environment
from .evaluate import body_maker, compare
from .small_trainings import bundled, small_nets
from .tasks import SEEDS, velocity

SHORT = 200         # steps, quick
COLUMNS = ("name", "epoch", "cpu", "own", "thrown", "full", "step")     # of tables: `Measured`


class Measured(NamedTuple):
    """A small training, and the mean squared errors of its laws; infinite where they broke down."""

    name: str
    epoch: int
    cpu: float          # of the training up to there [s]; without compilation
    training_run: float     # on the run that it learned from, fully observed [m^2]
    thrown: float       # mean over other velocities, the same points and grid [m^2]
    full: float         # on the environment's own run [m^2]; NaN: not run
    step: int           # in which the first of these runs broke down, -1 for none

    @property
    def compared(self):
        """The error to compare trainings of all sizes by: on the full run, if it was made."""
        return self.training_run if isnan(self.full) else self.full


def measured(run, names, full=True):
    """Return the `Measured` of trainings by name, of all stored epochs; full: whether also in the
    body of the environment.
    """
    bundles = load_available(run, names, bundled)
    for name, bundle in bundles.items():
        if bundle.about.get("stopped"):
            run.note(f"{name}: the training stopped in {bundle.about['stopped']}")
    all_laws = {(name, epoch): laws for name, bundle in bundles.items()
                for epoch, laws in bundle.laws.items()}
    groups = {}
    for key in all_laws:
        net = small_nets()[key[0]]
        groups.setdefault((net.environment, net.edge, net.cells), []).append(key)
    rows = [row for keys in run.progress(groups.values(), "sizes")
            for row in measured_of_size(run, {key: all_laws[key] for key in keys}, full)]
    return sorted(rows, key=lambda row: names.index(row.name))


def measured_of_size(run, laws, full):
    """Return the `Measured` of {(name, epoch): laws} that were trained on one scene."""
    net = small_nets()[next(iter(laws))[0]]
    makers = [body_maker(one) for one in laws.values()]
    results = [compare(cut(run, scene), makers) for scene in scenes(net, full)]
    rows = []
    for k, (name, epoch) in enumerate(laws):
        trained_run, *others = (errors[k] for errors in results)
        full_error = others.pop().error if full else np.nan
        steps = [errors[k].step for errors in results if errors[k].step >= 0]
        rows.append(Measured(name, epoch, training_seconds(name, epoch), trained_run.error,
                             float(np.mean([one.error for one in others])), full_error,
                             min(steps, default=-1)))
    return rows


def scenes(net, full):
    """Return the scene that a `Small` learns from, with other velocities, and if asked for the full
    one.
    """
    own = net.scene
    others = [with_(own, body=(with_(own.body[0], velocity=velocity(net.environment, seed)
                                     .body[0].velocity),)) for seed in SEEDS]
    return [own, *others, *([environment(net.environment)] if full else [])]


def cut(run, scene):
    """Return a scene, at quick its first steps."""
    return run.choose(quick=with_(scene, steps=SHORT), standard=scene)


def training_seconds(name, epoch):
    """Return the CPU seconds of a training up to an epoch; the first one, which compiles, counts as
    a usual one.
    """
    seconds = bundled(name).about["cpu_seconds"][:epoch]
    return float(sum(seconds[1:]) + np.median(seconds))


def seed_range(rows, names):
    """Return the smallest and the largest error on their own run, of trainings that differ by their
    seed alone; (NaN, NaN) where there is none.
    """
    errors = [row.training_run for row in rows if row.name in names]
    return (min(errors), max(errors)) if errors else (np.nan, np.nan)
