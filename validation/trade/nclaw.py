"""Errors of learned laws against the time of training, and against the observations."""

from math import isnan

from ..common.registry import experiment
from ..nclaw.small_runs import COLUMNS, measured, seed_range
from ..nclaw.small_trainings import BASE, OF_EPOCHS, OF_OBSERVATION, OF_TRAINING, SEEDS, small_nets
from .front import front

SIZE = ("environment", "edge", "cells", "epochs", "first", "last", "seed")
OBSERVATION = ("every", "share", "noise", "positions")


@experiment("trade.nclaw.training", title="NCLaw: error against the time of training",
            profiles=("quick", "standard"), budget={"quick": 12, "standard": 500})
def training(run):
    """Vary epochs, horizon, particles and grid of small trainings, whose laws are also run in the
    body of the paper.
    """
    names = [*OF_TRAINING, *OF_EPOCHS]
    found = measured(run, run.choose(quick=[BASE], standard=names), run.profile != "quick")
    rows = []
    for name in dict.fromkeys(small_nets()[row.name].environment for row in found):
        mine = [row for row in found if small_nets()[row.name].environment == name]
        best = front([row.cpu for row in mine], [row.compared for row in mine])
        for row, on in zip(mine, best, strict=True):
            net = small_nets()[row.name]
            rows.append((*row, *(getattr(net, key) for key in SIZE), int(on)))
            scale = f"{net.edge**3} particles, {net.cells} cells along an axis"
            record_training(run, row, scale, on)
    run.table("trainings", (*COLUMNS, *SIZE, "pareto"), rows)


def record_training(run, row, scale, on_front):
    """Record a training; on_front: whether its laws are on the Pareto front of error and cost."""
    full = "" if isnan(row.full) else f", in the body of the paper {row.full:.3g} m^2"
    best = "; nothing is better and cheaper" if on_front else ""
    run.record(f"{run.experiment.id}.{row.name}.{row.epoch}", row.training_run, unit="m^2",
               comparator="info", scale=scale,
               note=f"{row.cpu:.3g} CPU s of training; thrown differently {row.thrown:.3g} m^2"
                    f"{full}{breakdown_note(row)}{best}")


def breakdown_note(row):
    """Return the note on a run that broke down, "" if none did."""
    return f"; broke down in step {row.step}" if row.step >= 0 else ""


@experiment("trade.nclaw.sight", title="NCLaw: error against the observations of a run",
            profiles=("quick", "standard"), budget={"quick": 12, "standard": 200})
def observations(run):
    """Vary frames, points, noise and positions alone; compare with full observations by seed."""
    names = run.choose(quick=[BASE], standard=[*SEEDS, *OF_OBSERVATION])
    found = measured(run, names, full=False)
    least, most = seed_range(found, SEEDS)
    for row in found:
        run.record(f"trade.nclaw.sight.{row.name}", row.training_run, unit="m^2", comparator="info",
                   scale="216 particles, 100 epochs", note="full observations "
                   f"{least:.3g} to {most:.3g} m^2 by seed; thrown differently {row.thrown:.3g} m^2"
                   + breakdown_note(row))
    run.table("trainings", (*COLUMNS, *OBSERVATION), [
        (*row, *(getattr(small_nets()[row.name].observation, key) for key in OBSERVATION))
        for row in found])
