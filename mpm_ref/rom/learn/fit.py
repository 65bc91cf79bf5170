"""Training a decoder: seeds, schedule, checkpoints, history (LDM-appB).

A training that is cut off goes on from its last checkpoint. Its numbers are then those of an
uninterrupted one, on the same machine with the same number of threads; its cost is the sum over its
parts, of each up to its last checkpoint.
"""

import hashlib
import io
import json
from dataclasses import asdict, dataclass
from math import cos, pi
from typing import NamedTuple

import numpy as np
import torch

from ... import checkpoints
from ...cost import Cost, Meter
from ..architecture import HIDDEN
from ..modes import basis
from ..snapshots import units
from .data import batch_of, data_of
from .encoder import Encoder, Free, Given, codes
from .loss import CODE, Weights, loss
from .perceptron import Perceptron, exported

FASTEST, SLOWEST = 1e-3, 1e-6       # learning rates at the first and the last step (LDM-appB)
LATENTS = ("encoder", "free", "modes")
SAVE = 20                           # epochs between checkpoints
FORMAT = 2                          # of checkpoints


@dataclass(frozen=True)
class Training:
    """How a decoder is trained.

    r latent coordinates; `latent` "encoder" (LDM-sec4.1-encoder), "free" (LDMW-eq7), or those of
    POD "modes" in the norm of the loss, snapshots weighing as often as they are shown, which cost
    no encoder and are no unknowns; an epoch
    shows every snapshot once, `batch` at a time, each time at `points` random points (0: all); of
    the time levels from `dense` on, a random one in `thin`. The learning rate falls from FASTEST to
    SLOWEST by half a cosine.
    """

    r: int
    hidden: tuple = HIDDEN
    latent: str = "encoder"
    weights: Weights = CODE
    epochs: int = 850
    batch: int = 8
    points: int = 0
    dense: int = 0
    thin: int = 1
    seed: int = 0

    def __post_init__(self):
        for name in ("r", "epochs", "batch", "thin"):
            if getattr(self, name) < 1:
                raise ValueError(f"{name} = {getattr(self, name)}: expected at least 1")
        for name in ("points", "dense"):
            if getattr(self, name) < 0:
                raise ValueError(f"{name} = {getattr(self, name)}: expected 0 or more")
        if self.latent not in LATENTS:
            raise ValueError(f"latent = {self.latent!r}: expected one of {', '.join(LATENTS)}")


class Trained(NamedTuple):
    """A decoder, and what it was trained on knows of it."""

    decoder: object         # `rom.decoder.Decoder`
    xhat: np.ndarray        # (s, k + 1, r) latent coordinates of the training snapshots
    history: np.ndarray     # (epochs, 4) loss, and its terms, of each epoch
    cost: Cost              # of all parts of the training


class Session:
    """Networks, optimiser and random numbers of a training under way."""

    def __init__(self, training, snapshots):
        self.meter = Meter()
        torch.manual_seed(training.seed)
        self.training, self.units = training, units(snapshots)
        self.data = data_of(snapshots, self.units)
        self.of = sha256(snapshots)
        count, _, d = self.data.u.shape
        self.level = torch.arange(count) % snapshots.x.shape[1]
        self.f = Perceptron(d, training.r, training.hidden)
        self.encoder = encoder(training, snapshots)
        self.inputs = (self.data.standardised if training.latent == "encoder"
                       else torch.arange(count))
        weights = [*self.f.parameters(), *self.encoder.parameters()]
        self.optimiser = torch.optim.Adam(weights, lr=FASTEST)
        self.random = torch.Generator().manual_seed(training.seed)
        self.history = []

    @property
    def named(self):
        """The training's settings, and what it is trained on, as one line of text."""
        return json.dumps({"format": FORMAT, **asdict(self.training), "data": self.of})

    def epoch(self):
        """Show every snapshot once, or those whose turn it is, at least one."""
        order = torch.randperm(len(self.data.next), generator=self.random)
        if self.training.thin > 1:
            turn = torch.rand(len(order), generator=self.random) * self.training.thin < 1.0
            shown = order[(turn | (self.level < self.training.dense))[order]]
            order = shown if len(shown) else order[:1]
        batches = order.split(self.training.batch)
        done = [self.show(at, (len(self.history) + k / len(batches)) / self.training.epochs)
                for k, at in enumerate(batches)]
        self.history.append(torch.tensor(done).mean(dim=0).tolist())

    def show(self, at, progress):
        """One step of the optimiser on a batch of snapshots; its loss and terms."""
        for group in self.optimiser.param_groups:
            group["lr"] = rate(progress)
        batch = batch_of(self.data, at, self.some_points(), self.latents)
        self.optimiser.zero_grad()
        total, found = loss(self.f, batch, self.data.units, self.training.weights)
        total.backward()
        self.optimiser.step()
        return [total.item(), *(term.item() for term in found)]

    def some_points(self):
        """Numbers of the points that a batch is shown at."""
        n, wanted = len(self.data.X), self.training.points
        if not 0 < wanted < n:
            return torch.arange(n)
        return torch.randperm(n, generator=self.random)[:wanted]

    def latents(self, numbers):
        """Latent coordinates (s, r) of snapshots by number."""
        return self.encoder(self.inputs[numbers])

    def result(self, runs):
        """`Trained`, of so many runs."""
        xhat = codes(self.encoder, self.inputs).double().numpy()
        return Trained(exported(self.f, self.units), xhat.reshape(runs, -1, self.training.r),
                       np.array(self.history), self.meter.total)

    def save(self, path):
        """Checkpoint, whole or not at all."""
        content = io.BytesIO()
        torch.save({"training": self.named, "f": self.f.state_dict(),
                    "encoder": self.encoder.state_dict(), "random": self.random.get_state(),
                    "optimiser": self.optimiser.state_dict(), "history": self.history,
                    "cost": tuple(self.meter.total)}, content)
        checkpoints.write(path, content.getvalue())

    def load(self, path):
        """Go on from a checkpoint. Raises ValueError where it is damaged, or of another training
        or other data.
        """
        kept = torch.load(io.BytesIO(checkpoints.read(path)), weights_only=True)
        checkpoints.require_same(path, kept["training"], self.named)
        self.f.load_state_dict(kept["f"])
        self.encoder.load_state_dict(kept["encoder"])
        self.optimiser.load_state_dict(kept["optimiser"])
        self.random.set_state(kept["random"])
        self.history, self.meter.before = kept["history"], Cost(*kept["cost"])


def encoder(training, snapshots):
    """Where the latent coordinates of a training come from."""
    s, levels, n, d = snapshots.x.shape
    if training.latent == "encoder":
        return Encoder(d, n, training.r)
    if training.latent == "free":
        return Free(s * levels, training.r)
    shown = np.where(np.arange(levels) < training.dense, 1.0, 1.0 / training.thin)
    return Given(basis(snapshots.X, *snapshots.flat(), training.r, training.weights.F,
                       np.tile(np.sqrt(shown), s)).xhat)


def sha256(snapshots):
    """Digest of all that is trained on."""
    digest = hashlib.sha256(repr(float(snapshots.dt)).encode())
    for a in (snapshots.X, snapshots.x, snapshots.F, snapshots.v):
        digest.update(repr(a.shape).encode())
        digest.update(np.ascontiguousarray(a, dtype=float))
    return digest.hexdigest()


def rate(progress):
    """Learning rate at a share of the training: half a cosine."""
    return SLOWEST + 0.5 * (FASTEST - SLOWEST) * (1.0 + cos(pi * progress))


def train(training, snapshots, checkpoint=None, on_epoch=None):
    """`Trained` on the runs of `Snapshots`.

    checkpoint: a file to go on from and to save to; on_epoch(history) is called after each epoch.
    """
    session = Session(training, snapshots)
    return checkpoints.finished(session, training.epochs, SAVE, checkpoint, on_epoch).result(
        len(snapshots.x))
