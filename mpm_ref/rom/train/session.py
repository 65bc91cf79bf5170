"""Batches, learning rates and random numbers of a training of networks.

A training that is cut off goes on from its last checkpoint (see `training`). Its numbers are then
those of an uninterrupted one, on the same machine with the same number of threads; its cost is the
sum over its parts, of each up to its last checkpoint.
"""

import json
from dataclasses import asdict

import torch

from ... import training
from ...training import Diverged
from .schedule import SCHEDULES

SAVE = 20                           # epochs between checkpoints, but of a long training ...
PARTS = 200                         # ... this many checkpoints in all
FORMAT = 4                          # of checkpoints


class NetworkSession(training.TrainingSession):
    """Networks, optimiser and random numbers of a training under way.

    `settings` has the fields schedule, epochs, batch, points and seed; `data` is a digest of the
    training data, of `snapshots` snapshots at `points` points. Networks and data are on `device`;
    random numbers, and what they choose, are on the processor. Elsewhere the factors of products
    have 11 significant bits (TF32), sums those of single precision. A subclass names the networks
    (`learn`) and computes the error (`error`).
    """

    def __init__(self, settings, data, snapshots, points, device):
        super().__init__()
        torch.manual_seed(settings.seed)
        self.settings, self.data_digest = settings, data
        self.snapshots, self.points = snapshots, points
        self.device = device
        if not on_processor(device):
            torch.set_float32_matmul_precision("high")
        self.random = torch.Generator().manual_seed(settings.seed)

    def learn(self, **networks):
        """Take the weights of these networks as the unknowns."""
        self.networks = {name: net.to(self.device) for name, net in networks.items()}
        self.optimiser = torch.optim.Adam(
            [weights for net in networks.values() for weights in net.parameters()])

    @property
    def description(self):
        """The training's settings and the digest of its data, as one line of text."""
        return json.dumps({"format": FORMAT, **asdict(self.settings), "data": self.data_digest})

    def states(self):
        """Return {name: objects with `state_dict` and `load_state_dict`} of a checkpoint."""
        return {"random": [GeneratorState(self.random)], "optimiser": [self.optimiser],
                **{name: [net] for name, net in self.networks.items()}}

    def order(self):
        """Return the numbers of the snapshots that an epoch shows, in random order."""
        return torch.randperm(self.snapshots, generator=self.random)

    def epoch(self):
        """Show the snapshots of an epoch, a batch at a time."""
        batches = self.order().split(self.settings.batch)
        rows = [self.show(batch, (len(self.history) + k / len(batches)) / self.settings.epochs)
                for k, batch in enumerate(batches)]
        self.history.append(torch.tensor(rows).mean(dim=0).tolist())

    def show(self, batch, progress):
        """Make one step of the optimiser on a batch of snapshots (numbers); return its loss and
        terms. Raises `Diverged`.
        """
        for group in self.optimiser.param_groups:
            group["lr"] = SCHEDULES[self.settings.schedule](progress)
        self.optimiser.zero_grad()
        total, terms = self.error(batch)
        if not torch.isfinite(total):
            raise Diverged(f"epoch {len(self.history) + 1}: the loss is {total.item()}. Are the "
                           "data finite? If so, try smaller layers or another seed")
        total.backward()
        self.optimiser.step()
        return [total.item(), *(term.item() for term in terms)]

    def error(self, batch):
        """Return the loss of a batch of snapshots, and its terms."""
        raise NotImplementedError

    def draw_points(self):
        """Return the numbers of the points that a batch is shown at."""
        if not 0 < self.settings.points < self.points:
            return torch.arange(self.points)
        return torch.randperm(self.points, generator=self.random)[:self.settings.points]

    def draw_jitter(self, snapshots, r):
        """Return differences of latent coordinates (snapshots, r), normal with deviations of up to
        `settings.jitter`.
        """
        size = self.settings.jitter * torch.rand(snapshots, 1, generator=self.random)
        return (size * torch.randn(snapshots, r, generator=self.random)).to(self.device)


def on_processor(device):
    """Return whether a `torch.device`, or the device of a name, is the processor."""
    return torch.device(device).type == "cpu"


class GeneratorState:
    """The state of a random number generator, as a checkpoint stores it."""

    def __init__(self, generator):
        self.generator = generator

    def state_dict(self):
        """Return the state."""
        return self.generator.get_state()

    def load_state_dict(self, state):
        """Set the state."""
        self.generator.set_state(state)


def checkpoint_interval(epochs, least):
    """Return the epochs between the checkpoints of a training of `epochs`: at least `least`."""
    return max(least, epochs // PARTS)


def require_valid(settings, counts, non_negative):
    """Raise ValueError unless the settings named in `counts` are at least 1, those in
    `non_negative` 0 or more, and the schedule exists.
    """
    for names, least, expected in ((counts, 1, "at least 1"), (non_negative, 0, "0 or more")):
        for name in names:
            if getattr(settings, name) < least:
                raise ValueError(f"{name} = {getattr(settings, name)}: expected {expected}")
    require_one_of("schedule", settings.schedule, SCHEDULES)


def require_one_of(name, value, allowed):
    """Raise ValueError unless a value is one of those allowed."""
    if value not in allowed:
        raise ValueError(f"{name} = {value!r}: expected one of {', '.join(allowed)}")
