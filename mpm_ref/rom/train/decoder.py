"""Training a decoder, and where its latent coordinates come from (LDM-appB, NSF-sec4.5)."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import torch

from ...training import Cost, train_epochs
from ..fields.architecture import ENCODERS, HIDDEN
from ..fields.pod import basis, directions
from ..snapshots import units
from . import session
from .data import batch_of, data_of
from .encoder import Encoder, Free, Given, codes
from .loss import CODE, Weights, loss
from .perceptron import Perceptron, exported
from .session import SAVE, require_known, require_sound, saving, sha256

DIRECTIONS = "directions"
LATENTS = (*ENCODERS, "free", "modes", DIRECTIONS)


@dataclass(frozen=True)
class Training:
    """How a decoder is trained.

    r latent coordinates; `latent` "encoder" (LDM-sec4.1-encoder), "encoder-nsf" (NSF-encoder),
    "free" (LDMW-eq7), or those of POD "modes" in the norm of the loss, snapshots weighing as often
    as they are shown, which cost no encoder and are no unknowns, or of their "directions", all in
    one unit of length; an epoch shows every snapshot
    once, `batch` at a time, each time at `points` random points (0: all); of the time levels from
    `dense` on, a random one in `thin`. Learning rates are those of a `schedule` over all epochs.

    beside: snapshots are shown displaced along the directions, each time by others, of normal
    coordinates with standard deviations up to this one. What the map is like in all directions is
    in no snapshot: dg/dxhat of the weak ones is then that of the modes, and not of the error.
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
    schedule: str = "cosine"
    beside: float = 0.0

    def __post_init__(self):
        require_sound(self, ("r", "epochs", "batch", "thin"), ("points", "dense", "beside"))
        require_known("latent", self.latent, LATENTS)


class Trained(NamedTuple):
    """A decoder, and what it was trained on knows of it."""

    decoder: object         # `rom.fields.network.Decoder`
    xhat: np.ndarray        # (s, k + 1, r) latent coordinates of the training snapshots
    history: np.ndarray     # (epochs, 4) loss, and its terms, of each epoch
    cost: Cost              # of all parts of the training


class Session(session.Session):
    """A decoder and its latent coordinates under training."""

    def __init__(self, training, snapshots, device="cpu"):
        require_derivatives(training, snapshots)
        s, levels, n, d = snapshots.x.shape
        known = snapshots.X, snapshots.x, snapshots.F, snapshots.v
        super().__init__(training, sha256(snapshots.dt, [a for a in known if a is not None]),
                         s * levels, n, device)
        self.units = units(snapshots)
        self.data = data_of(snapshots, self.units, device=device)
        self.level = torch.arange(self.snapshots) % levels
        self.f = Perceptron(d, training.r, training.hidden)
        self.encoder = encoder(training, snapshots)
        self.inputs = (self.data.standardised if training.latent in ENCODERS
                       else torch.arange(self.snapshots, device=device))
        self.learn(f=self.f, encoder=self.encoder)

    def order(self):
        """Every snapshot once, or those whose turn it is, at least one."""
        order = super().order()
        if self.training.thin > 1:
            turn = torch.rand(len(order), generator=self.random) * self.training.thin < 1.0
            shown = order[(turn | (self.level < self.training.dense))[order]]
            order = shown if len(shown) else order[:1]
        return order

    def error(self, at):
        """Loss of a batch of snapshots, and its terms."""
        points = self.some_points()
        batch = batch_of(self.data, at, points, self.latents)
        if self.training.beside:
            batch = displaced(batch, self.away(len(at), self.training.r),
                              self.encoder.modes[points])
        return loss(self.f, batch, self.data.units, self.training.weights)

    def latents(self, numbers):
        """Latent coordinates (s, r) of snapshots by number."""
        return self.encoder(self.inputs[numbers])

    def result(self, runs):
        """`Trained`, of so many runs."""
        xhat = codes(self.encoder, self.inputs).cpu().double().numpy()
        return Trained(exported(self.f, self.units), xhat.reshape(runs, -1, self.training.r),
                       np.array(self.history), self.meter.total)


def displaced(batch, away, modes):
    """A `Batch` of s snapshots at m points, moved along modes (m, d, r) by coordinates (s, r)."""
    u = torch.einsum("mdr,sr->smd", modes, away).flatten(0, 1)
    return batch._replace(u=batch.u + u,
                          xhat=batch.xhat + away.repeat_interleave(len(modes), dim=0))


def require_derivatives(training, snapshots):
    """Raise ValueError where a training asks for F and v of snapshots that have none."""
    asks = training.weights.F or training.weights.v or training.latent == "modes"
    if snapshots.F is None and asks:
        raise ValueError(f"snapshots of positions alone, for latent = {training.latent!r} and "
                         f"{training.weights}: expected weights of 0, and other latents than modes")
    if training.beside and (training.latent != DIRECTIONS or any(training.weights)):
        raise ValueError(f"beside = {training.beside:g}, with latent = {training.latent!r} and "
                         f"{training.weights}: expected latent = {DIRECTIONS!r} and weights of 0, "
                         "since displacements alone are known beside the snapshots")


def encoder(training, snapshots):
    """Where the latent coordinates of a training come from."""
    s, levels, n, d = snapshots.x.shape
    if training.latent in ENCODERS:
        return Encoder(ENCODERS[training.latent](d, n), training.r)
    if training.latent == "free":
        return Free(s * levels, training.r)
    if training.latent == DIRECTIONS:
        modes, xhat = directions(snapshots.X, snapshots.x.reshape(s * levels, n, d), training.r)
        return Given(xhat, modes)
    shown = np.where(np.arange(levels) < training.dense, 1.0, 1.0 / training.thin)
    return Given(basis(snapshots.X, *snapshots.flat(), training.r, training.weights.F,
                       np.tile(np.sqrt(shown), s)).xhat)


def train(training, snapshots, checkpoint=None, on_epoch=None, device="cpu"):
    """`Trained` on the runs of `Snapshots`.

    checkpoint: a file to go on from and to save to; on_epoch(history) is called after each epoch;
    device: a `torch.device`, or its name. Raises `session.Diverged`.
    """
    done = train_epochs(Session(training, snapshots, device), training.epochs,
                                saving(training.epochs, SAVE), checkpoint, on_epoch)
    return done.result(len(snapshots.x))
