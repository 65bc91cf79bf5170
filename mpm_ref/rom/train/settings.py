"""A training from plain settings, as a file has them."""

import torch

from ...training import Machine
from .decoder import Training, train
from .device import device_of
from .loss import CODE, READINGS, scaled

MACHINE = Machine()


def fitted(settings, snapshots, checkpoint, on_epoch, machine=MACHINE):
    """`Trained` by {name of a field of `Training`: value} on a `Machine`; checkpoint and on_epoch
    as for `train`. Raises ValueError for a device that is not there.
    """
    torch.set_num_threads(machine.threads)
    return train(Training(**settings), snapshots, checkpoint, on_epoch, device_of(machine.device))


def weights(name, length, time):
    """`Weights` by their name in READINGS; "scaled" are those of the code for a body and steps that
    are so many times larger.
    """
    return scaled(CODE, length, time) if name == "scaled" else READINGS[name]


def version():
    """PyTorch's."""
    return torch.__version__
