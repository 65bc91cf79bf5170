"""Trainings from plain settings, as a study file has them, on a device.

Random numbers are always drawn on the processor, so that a training is shown the same points on
every device; what is computed from them differs in rounding.
"""

from dataclasses import replace

import torch

from ...training import DEVICES, Machine
from .decoder import DIRECTIONS, DecoderTraining, train_decoder
from .loss import CODE, READINGS, scale_weights
from .stages import StagePlan, printed_plan, train_stages

MACHINE = Machine()


def device_of(name):
    """Return the `torch.device` of a name in DEVICES. Raises ValueError for others, and for a
    graphics processor that PyTorch does not find.
    """
    if name not in DEVICES:
        raise ValueError(f"device {name!r}: expected one of {', '.join(DEVICES)}")
    if name == "cuda" and not torch.cuda.is_available():
        raise ValueError('device "cuda": PyTorch finds no graphics processor here; expected "cpu", '
                         "or a build of PyTorch with CUDA on a machine that has one")
    return torch.device(name)


def torch_version():
    """Return the version of PyTorch."""
    return torch.__version__


def loss_weights(name, length, time):
    """Return the `LossWeights` of a name in READINGS; "scaled" are those of the code for a body
    that is `length` times and steps that are `time` times larger.
    """
    return scale_weights(CODE, length, time) if name == "scaled" else READINGS[name]


def fit_decoder(settings, snapshots, checkpoint, on_epoch, machine=MACHINE):
    """Return `TrainedDecoder` by {name of a field of `DecoderTraining`: value} on a `Machine`;
    checkpoint and on_epoch as for `train_decoder`. Raises ValueError for a device that does not
    exist.
    """
    torch.set_num_threads(machine.threads)
    return train_decoder(DecoderTraining(**settings), snapshots, checkpoint, on_epoch,
                         device_of(machine.device))


def fit_stages(settings, histories, folder, on_epoch, machine=MACHINE):
    """Return `TrainedStages` by {name: value} as `stage_plan` takes them, on a `Machine`; folder
    and on_epoch as for `train_stages`. Raises ValueError for a device that does not exist.
    """
    torch.set_num_threads(machine.threads)
    return train_stages(stage_plan(settings, histories.X.shape[1]), histories, folder, on_epoch,
                        device_of(machine.device))


def stage_plan(settings, dim):
    """Return the printed `StagePlan` with other numbers: r, stress_sees_parameters, beta, latent
    ("modes": in one unit of length), epochs of the position, octaves and field_epochs of the other
    two networks; batch, points, seed and schedule of all three.
    """
    printed = printed_plan(dim, settings["r"], settings["beta"], settings["stress_sees_parameters"])
    common = {name: settings[name] for name in ("batch", "points", "seed", "schedule")}
    latent = DIRECTIONS if settings["latent"] == "modes" else settings["latent"]
    g = replace(printed.g, epochs=settings["epochs"], latent=latent, **common)
    common |= {"epochs": settings["field_epochs"], "octaves": settings["octaves"]}
    return StagePlan(g, *(replace(field, **common) for field in (printed.h, printed.l)))
