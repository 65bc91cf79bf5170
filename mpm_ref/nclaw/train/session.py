"""The state of a training as a checkpoint, of laws and of graph networks alike.

A training that is cut off goes on from its last checkpoint, with the numbers of one that was not,
on the same machine with the same number of threads.
"""

import io

import torch

from ...store import weights_file
from ...training import Cost, Meter


class Diverged(ValueError):
    """A loss or a gradient is not finite, or a run left its box."""


class TrainingSession:
    """A training under way; a subclass gives `entry`, `settings`, `states`, `restore` and `epoch`.

    entry:      the NamedTuple of an entry of the history
    settings    one line of text: the settings of the training, what is trained and on what
    states()    {name: state} of all that changes, plain or of PyTorch
    restore(stored)     puts such states back
    epoch()     trains for one epoch, and adds to the history
    """

    def __init__(self):
        self.meter, self.history = Meter(), []

    def save(self, path):
        """Write a checkpoint, whole or not at all."""
        content = io.BytesIO()
        torch.save({"training": self.settings, "history": [tuple(one) for one in self.history],
                    "cost": tuple(self.meter.total), **self.states()}, content)
        weights_file.write_sealed(path, content.getvalue())

    def load(self, path):
        """Go on from a checkpoint. Raises ValueError where it is damaged, or of another training,
        other laws or other data.
        """
        stored = torch.load(io.BytesIO(weights_file.read_sealed(path)), weights_only=True)
        weights_file.require_same_training(path, stored["training"], self.settings)
        self.restore(stored)
        self.history = [self.entry(*row) for row in stored["history"]]
        self.meter.before = Cost(*stored["cost"])
