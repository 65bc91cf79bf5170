"""What all trainings of networks share: seeds, batches, rates, checkpoints, history.

A training that is cut off goes on from its last checkpoint. Its numbers are then those of an
uninterrupted one, on the same machine with the same number of threads; its cost is the sum over its
parts, of each up to its last checkpoint.
"""

import hashlib
import io
import json
from dataclasses import asdict

import numpy as np
import torch

from ...store import weights_file
from ...training import Cost, Meter
from .schedule import SCHEDULES

SAVE = 20                           # epochs between checkpoints, but of a long training ...
PARTS = 200                         # ... so many checkpoints in all
FORMAT = 3                          # of checkpoints
LATER = ("octaves",)                # settings older ones do not name; told where they are not 0


class Diverged(ValueError):
    """A loss is not finite."""


class Session:
    """Networks, optimiser and random numbers of a training under way.

    `training` has the fields schedule, epochs, batch, points and seed; `of` is a digest of what is
    trained on, so many snapshots of so many points; networks and data are on `device`, random
    numbers and what they choose are not. A subclass says what it learns (`learn`) and what the
    error is of (`error`).
    """

    def __init__(self, training, of, snapshots, points, device):
        self.meter = Meter()
        torch.manual_seed(training.seed)
        self.training, self.of = training, of
        self.snapshots, self.points = snapshots, points
        self.device = device
        self.random = torch.Generator().manual_seed(training.seed)
        self.history = []

    def learn(self, **networks):
        """Have these networks' weights as unknowns."""
        self.networks = {name: net.to(self.device) for name, net in networks.items()}
        self.optimiser = torch.optim.Adam(
            [own for net in networks.values() for own in net.parameters()])

    @property
    def named(self):
        """The training's settings, and what it is trained on, as one line of text."""
        settings = {name: value for name, value in asdict(self.training).items()
                    if name not in LATER or value}
        return json.dumps({"format": FORMAT, **settings, "data": self.of})

    def order(self):
        """Numbers of the snapshots that an epoch shows, at random."""
        return torch.randperm(self.snapshots, generator=self.random)

    def epoch(self):
        """Show the snapshots of an epoch, a batch at a time."""
        batches = self.order().split(self.training.batch)
        done = [self.show(at, (len(self.history) + k / len(batches)) / self.training.epochs)
                for k, at in enumerate(batches)]
        self.history.append(torch.tensor(done).mean(dim=0).tolist())

    def show(self, at, progress):
        """One step of the optimiser on a batch of snapshots; its loss and terms."""
        for group in self.optimiser.param_groups:
            group["lr"] = SCHEDULES[self.training.schedule](progress)
        self.optimiser.zero_grad()
        total, found = self.error(at)
        if not torch.isfinite(total):
            raise Diverged(f"epoch {len(self.history) + 1}: the loss is {total.item()}. Are the "
                           "data finite? If so, try smaller layers or another seed")
        total.backward()
        self.optimiser.step()
        return [total.item(), *(term.item() for term in found)]

    def error(self, at):
        """Loss of a batch of snapshots, and its terms: for the kinds of training to say."""
        raise NotImplementedError

    def some_points(self):
        """Numbers of the points that a batch is shown at."""
        if not 0 < self.training.points < self.points:
            return torch.arange(self.points)
        return torch.randperm(self.points, generator=self.random)[:self.training.points]

    def away(self, snapshots, r):
        """Coordinates (snapshots, r) to show these beside their own, normal with deviations of up
        to `training.beside`.
        """
        far = self.training.beside * torch.rand(snapshots, 1, generator=self.random)
        return (far * torch.randn(snapshots, r, generator=self.random)).to(self.device)

    def save(self, path):
        """Checkpoint, whole or not at all."""
        content = io.BytesIO()
        torch.save({"training": self.named, "random": self.random.get_state(),
                    "optimiser": self.optimiser.state_dict(), "history": self.history,
                    "cost": tuple(self.meter.total),
                    **{name: net.state_dict() for name, net in self.networks.items()}}, content)
        weights_file.write_sealed(path, content.getvalue())

    def load(self, path):
        """Go on from a checkpoint. Raises ValueError where it is damaged, or of another training
        or other data.
        """
        kept = torch.load(io.BytesIO(weights_file.read_sealed(path)), map_location="cpu",
                          weights_only=True)
        weights_file.require_same_training(path, kept["training"], self.named)
        for name, net in self.networks.items():
            net.load_state_dict(kept[name])
        self.optimiser.load_state_dict(kept["optimiser"])
        self.random.set_state(kept["random"])
        self.history, self.meter.before = kept["history"], Cost(*kept["cost"])


def saving(epochs, least):
    """Epochs between the checkpoints of a training of so many: no fewer than the least."""
    return max(least, epochs // PARTS)


def require_sound(training, counts, or_zero):
    """Raise ValueError unless the named settings of a training are at least 1, others 0 or more,
    and its schedule is known.
    """
    for names, least, said in ((counts, 1, "at least 1"), (or_zero, 0, "0 or more")):
        for name in names:
            if getattr(training, name) < least:
                raise ValueError(f"{name} = {getattr(training, name)}: expected {said}")
    require_known("schedule", training.schedule, SCHEDULES)


def require_known(name, value, known):
    """Raise ValueError unless a value is one of those known."""
    if value not in known:
        raise ValueError(f"{name} = {value!r}: expected one of {', '.join(known)}")


def sha256(dt, arrays):
    """Digest of what is trained on: the length of a step [s], and arrays."""
    digest = hashlib.sha256(repr(float(dt)).encode())
    for a in arrays:
        digest.update(f"{a.shape} {a.dtype}".encode())
        digest.update(np.ascontiguousarray(a))
    return digest.hexdigest()
