"""Common parts of all trainings: import of PyTorch on demand, device, time and checkpoints.

A training that is cut off continues from its checkpoint: `TrainingSession` saves and loads one, at
the intervals of `train_epochs`.
"""

import hashlib
import io
from importlib import import_module
from pathlib import Path
from time import perf_counter, process_time
from typing import NamedTuple

import numpy as np

from .store import weights_file

DEVICES = "cpu", "cuda"


class Machine(NamedTuple):
    """The threads and the device that a training runs on."""

    threads: int = 1        # of PyTorch
    device: str = "cpu"     # of DEVICES


def import_with_torch(name, what, instead):
    """Return the module mpm_ref.NAME, which imports torch.

    Raises ValueError without PyTorch; the message says what needs it, and what works without.
    """
    try:
        return import_module(f"mpm_ref.{name}")
    except ModuleNotFoundError as fault:
        if fault.name != "torch":
            raise
        raise ValueError(f"{what} with PyTorch, which is not installed: pip install "
                         '"mpm_ref[learn]", or `make learn` in the repository; '
                         f"{instead}") from None


class TrainingTime(NamedTuple):
    """The time that a training takes."""

    cpu: float          # [s], of all threads
    wall: float         # [s]


class Meter:
    """A stopwatch that starts at once, and adds the time of earlier parts of the training."""

    def __init__(self):
        self.before, self.start = TrainingTime(0.0, 0.0), clocks()

    @property
    def total(self):
        """`TrainingTime` up to now."""
        return TrainingTime(*(a + now - start for a, now, start in
                      zip(self.before, clocks(), self.start, strict=True)))


def clocks():
    """Return the readings of the two clocks."""
    return TrainingTime(process_time(), perf_counter())


class Diverged(ValueError):
    """A training whose loss or gradient is not finite, or in which a run breaks down."""


class TrainingSession:
    """A training under way: its history, its time, and its checkpoints.

    A subclass has `epoch()`, which appends an entry to `history`; `description`, one line of text
    on the networks and the data; and `states()`.
    """

    entry = list        # type of an entry of `history`, made from a row of a checkpoint

    def __init__(self):
        self.meter, self.history = Meter(), []

    def states(self):
        """Return {name: objects with `state_dict` and `load_state_dict`} of a checkpoint."""
        raise NotImplementedError

    def save(self, path):
        """Write a checkpoint, in full or not at all."""
        import torch

        content = io.BytesIO()
        states = {name: [one.state_dict() for one in parts]
                  for name, parts in self.states().items()}
        torch.save({"training": self.description, "cost": tuple(self.meter.total),
                    "history": [tuple(entry) for entry in self.history], **states}, content)
        weights_file.write_checkpoint(path, content.getvalue())

    def load(self, path):
        """Continue from a checkpoint. Raises ValueError where it is damaged, or of another training
        or other data.
        """
        import torch

        stored = torch.load(io.BytesIO(weights_file.read_checkpoint(path)), map_location="cpu",
                            weights_only=True)
        weights_file.require_same_training(path, stored["training"], self.description)
        for name, parts in self.states().items():
            for part, state in zip(parts, stored[name], strict=True):
                part.load_state_dict(state)
        self.history = [self.entry(row) for row in stored["history"]]
        self.meter.before = TrainingTime(*stored["cost"])


def sha256(*values):
    """Return the sha256 of arrays and plain values that a training reads."""
    digest = hashlib.sha256()
    for value in values:
        if isinstance(value, np.ndarray):
            digest.update(f"{value.shape} {value.dtype}".encode())
            digest.update(np.ascontiguousarray(value))
        else:
            digest.update(repr(value).encode())
    return digest.hexdigest()


def train_epochs(session, epochs, every, checkpoint=None, on_epoch=None):
    """Return the `TrainingSession`, trained up to a number of epochs.

    checkpoint: a file to go on from, and to save to every `every` epochs; on_epoch(history) is
    called after each epoch. Raises ValueError where the folder of the checkpoint is missing.
    """
    path = None if checkpoint is None else Path(checkpoint)
    if path is not None and not path.parent.is_dir():
        raise ValueError(f"{path}: there is no folder {path.parent}; create it or name another one")
    if path is not None and path.exists():
        session.load(path)
    while len(session.history) < epochs:
        session.epoch()
        if path is not None and len(session.history) % every == 0:
            session.save(path)
        if on_epoch is not None:
            on_epoch(session.history)
    return session
