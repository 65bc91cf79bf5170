"""A training of NSF's three networks from plain settings, as a file has them."""

from dataclasses import replace

import torch

from . import stages
from .decoder import DIRECTIONS
from .device import device_of
from .settings import MACHINE


def fitted(settings, histories, folder, on_epoch, machine=MACHINE):
    """`Stages` by {name: value} as `plan` takes them, on a `Machine`; folder and on_epoch as for
    `stages.train`. Raises ValueError for a device that is not there.
    """
    torch.set_num_threads(machine.threads)
    return stages.train(plan(settings, histories.X.shape[1]), histories, folder, on_epoch,
                        device_of(machine.device))


def plan(settings, dim):
    """The printed `Plan` with other numbers: r, told (whether the stress is told the parameters),
    beta, latent ("modes": in one unit of length), epochs of the position, octaves and field_epochs
    of the other two; batch, points, seed and schedule of all three.
    """
    printed = stages.printed(dim, settings["r"], settings["beta"], settings["told"])
    how = {name: settings[name] for name in ("batch", "points", "seed", "schedule")}
    latent = DIRECTIONS if settings["latent"] == "modes" else settings["latent"]
    g = replace(printed.g, epochs=settings["epochs"], latent=latent, **how)
    how |= {"epochs": settings["field_epochs"], "octaves": settings["octaves"]}
    return stages.Plan(g, *(replace(own, **how) for own in (printed.h, printed.l)))
