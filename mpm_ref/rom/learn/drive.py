"""A training from plain settings, as a file has them."""

import torch

from .fit import Training, train
from .loss import CODE, READINGS, scaled


def fitted(settings, snapshots, checkpoint, on_epoch, threads=1):
    """`Trained` by {name of a field of `Training`: value} on so many threads; checkpoint and
    on_epoch as for `train`.
    """
    torch.set_num_threads(threads)
    return train(Training(**settings), snapshots, checkpoint, on_epoch)


def weights(name, length, time):
    """`Weights` by their name in READINGS; "scaled" are those of the code for a body and steps that
    are so many times larger.
    """
    return scaled(CODE, length, time) if name == "scaled" else READINGS[name]


def version():
    """PyTorch's."""
    return torch.__version__
