"""`python -m validation.training.nsf NAME...`: train the three networks of NSF's scenes anew.

It needs PyTorch. An interrupted training continues from the checkpoints of its stages.
"""

from dataclasses import asdict
from shutil import rmtree

import numpy as np
import typer
from tqdm import tqdm

from mpm_ref.rom.model_file import save
from mpm_ref.rom.snapshots import join_histories
from mpm_ref.rom.study.dataset import simulate_history
from mpm_ref.rom.train.decoder import DecoderTraining
from mpm_ref.rom.train.field import FieldTraining
from mpm_ref.rom.train.settings import device_of
from mpm_ref.rom.train.stages import POSITION, StagePlan, train_stages
from mpm_ref.training import DEVICES, Machine, TrainingTime

from ..nsf.networks import FOLDER, identity, narrow, nets
from ..nsf.printed_networks import printed_nets
from ..nsf.printed_rates import rates_nets
from .common import CHECKPOINTS, Checkpoints, Device, Folder, Names, Threads, origin, train_all

SHOWN = 50                  # epochs of which the loss is stored
LEVELS, POINTS = 12, 5000   # time levels of each run for the errors, and points, about


def plan_of(net):
    """Return the `StagePlan` of a `FieldsNet`."""
    options = {name: getattr(net, name) for name in ("batch", "points", "schedule", "seed")}
    follows = {"h": net.study.follows, "l": False}
    g = DecoderTraining(net.study.sizes.r, net.g.hidden, net.latent, POSITION, net.g.epochs,
                        jitter=net.g.jitter, **options)
    return StagePlan(g, *(FieldTraining(own.hidden, follows[name], own.epochs, jitter=own.jitter,
                                        octaves=net.octaves, **options)
                          for name, own in (("h", net.h), ("l", net.l))))


def runs_of(study):
    """Return the `Histories` of a study's training runs."""
    values = tqdm(study.train, desc="runs")
    return join_histories((simulate_history(study.run(value), [value], np.float32, study.spacing)
                           for value in values), len(study.train))


class ProgressBar:
    """The bar of a `FieldsNet`'s training; an epoch of a network counts as many steps as its hidden
    layers have products.
    """

    def __init__(self, net, bar):
        self.each = {name: getattr(net, name).width**2 for name in "ghl"}
        self.bar, self.done = bar, dict.fromkeys("ghl", 0)

    @staticmethod
    def total(net):
        """Return the number of steps of all stages."""
        return sum(getattr(net, name).epochs * getattr(net, name).width**2 for name in "ghl")

    def show(self, stage, losses):
        """Move the bar after an epoch of a stage."""
        self.bar.update(self.each[stage] * (len(losses) - self.done[stage]))
        self.done[stage] = len(losses)
        self.bar.set_postfix(stage=stage, loss=f"{np.ravel(losses[-1])[0]:.1e}")


def trainings():
    """Return {name: `FieldsNet`} of all trainings."""
    return nets() | narrow() | printed_nets() | rates_nets()


def trained_fields(name, checkpoints, machine):
    """Return the trained `Model` of a name, with how it was made."""
    net = trainings()[name]
    checkpoints.mkdir(parents=True, exist_ok=True)
    runs = runs_of(net.study)
    with tqdm(total=ProgressBar.total(net), desc=name, unit_scale=True) as bar:
        done = train_stages(plan_of(net), runs, checkpoints, ProgressBar(net, bar).show,
                            device_of(machine.device))
    stages = done._asdict().items()
    seconds = {f"{clock}_seconds": {stage: round(getattr(own.cost, clock), 1)
                                    for stage, own in stages}
               for clock in TrainingTime._fields}
    plan = {stage: asdict(own) for stage, own in plan_of(net)._asdict().items()}
    return done.model({
        **identity(net), "plan": plan, "errors": errors_of(done.model({}), runs),
        "losses": losses(done), **seconds, **machine._asdict(), **origin("nsf", name)})


def errors_of(model, runs):
    """Return the errors of the networks on some of their training snapshots at some points, over
    the norms of the snapshots' fields.
    """
    sums = {name: np.zeros(2) for name in ("displacement", "stress", "affine")}
    shown = slice(None, None, -(-len(runs.X) // POINTS))
    for run, mu in enumerate(runs.mu):
        for k in range(0, runs.x.shape[1], -(-runs.x.shape[1] // LEVELS)):
            xhat, X, (g, h, l) = model.xhat[run, k], runs.X[shown], model.field
            x, tau, C = (a[run, k, shown] for a in (runs.x, runs.tau, runs.C))
            for name, prediction, reference in (
                    ("displacement", g.place(X, xhat) - X, x - X),
                    ("stress", h.values(X, xhat, h.needed_parameters(mu)), tau),
                    ("affine", l.values(X, xhat, l.needed_parameters(mu)), C)):
                sums[name] += (np.sum((prediction - reference)**2),
                               np.sum(reference**2, dtype=float))
    return {name: float(np.sqrt(off / norm)) for name, (off, norm) in sums.items()}


def losses(done):
    """Return {stage: [loss of some epochs, the last one among them]} of `Stages`."""
    shown = {}
    for stage, own in done._asdict().items():
        every = own.history.reshape(len(own.history), -1)[:, 0]
        shown[stage] = every[::-1][::max(1, len(every) // SHOWN)][::-1].tolist()
    return shown


def main(names: Names = None, folder: Folder = FOLDER, checkpoints: Checkpoints = CHECKPOINTS,
         threads: Threads = 1, device: Device = DEVICES[0]):
    """Train networks and write their weights."""
    machine = Machine(threads, device)

    def make(name, folder, checkpoints):
        stages = checkpoints / f"fields-{name}"
        save(folder / f"{name}.npz", trained_fields(name, stages, machine))
        rmtree(stages)

    train_all(names, trainings(), (folder, checkpoints), threads, make)


if __name__ == "__main__":
    typer.run(main)
