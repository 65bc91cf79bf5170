"""A training from plain settings, as a file has them."""

import torch

from .fit import Training, train
from .loss import READINGS


def fitted(settings, snapshots, checkpoint, on_epoch, threads=1):
    """`Trained` by {name of a field of `Training`: value}, the weights by their name in READINGS,
    on so many threads; checkpoint and on_epoch as for `train`.
    """
    torch.set_num_threads(threads)
    training = Training(**{**settings, "weights": READINGS[settings["weights"]]})
    return train(training, snapshots, checkpoint, on_epoch)


def version():
    """PyTorch's."""
    return torch.__version__
