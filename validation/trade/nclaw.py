"""What the errors of learned laws cost in training, and what they owe to what was seen."""

from math import isnan

from ..common.registry import experiment
from ..nclaw.small_runs import COLUMNS, measured, seed_range
from ..nclaw.small_trainings import BASE, OF_EPOCHS, OF_OBSERVATION, OF_TRAINING, SEEDS, small_nets
from .front import front

SIZE = ("environment", "edge", "cells", "epochs", "first", "last", "seed")
SIGHT = ("every", "share", "noise", "positions")


@experiment("trade.nclaw.training", title="NCLaw: error against the time of training",
            profiles=("quick", "standard"), budget={"quick": 12, "standard": 500})
def training(run):
    """By epochs, horizon, particles and grid; small trainings, whose laws are then also run in the
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
            record(run, row, f"{net.edge**3} particles, {net.cells} cells along an axis", on)
    run.table("trainings", (*COLUMNS, *SIZE, "pareto"), rows)


def record(run, row, scale, on):
    """Record a training; on: whether its laws are on the front of error and cost."""
    whole = "" if isnan(row.full) else f", in the body of the paper {row.full:.3g} m^2"
    best = "; nothing is better and cheaper" if on else ""
    run.record(f"{run.experiment.id}.{row.name}.{row.epoch}", row.training_run, unit="m^2",
               comparator="info", scale=scale,
               note=f"{row.cpu:.3g} CPU s of training; thrown otherwise {row.thrown:.3g} m^2{whole}"
                    f"{broken(row)}{best}")


def broken(row):
    """The words on a run that broke down; none if none did."""
    return f"; broke down in step {row.step}" if row.step >= 0 else ""


@experiment("trade.nclaw.sight", title="NCLaw: error against what is seen of a run",
            profiles=("quick", "standard"), budget={"quick": 12, "standard": 200})
def sight(run):
    """Frames, points, noise, and positions alone; beside trainings of other seeds that see all."""
    names = run.choose(quick=[BASE], standard=[*SEEDS, *OF_OBSERVATION])
    found = measured(run, names, full=False)
    least, most = seed_range(found, SEEDS)
    for row in found:
        run.record(f"trade.nclaw.sight.{row.name}", row.training_run, unit="m^2", comparator="info",
                   scale="216 particles, 100 epochs", note="seeing all "
                   f"{least:.3g} to {most:.3g} m^2 by seed; thrown otherwise {row.thrown:.3g} m^2"
                   + broken(row))
    run.table("trainings", (*COLUMNS, *SIGHT),
              [(*row, *(getattr(small_nets()[row.name].observation, key) for key in SIGHT))
               for row in found])
