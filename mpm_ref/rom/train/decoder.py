"""Training of a decoder, with or without an encoder of its latent coordinates (LDM-appB,
NSF-sec4.5).
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import torch

from ...training import TrainingTime, sha256, train_epochs
from ..fields.architecture import ENCODERS, HIDDEN
from ..fields.pod import basis, directions
from ..snapshots import decoder_units
from .loss import CODE, LossWeights, batch_of, loss, tensors_of
from .networks import Encoder, FieldPerceptron, FixedLatents, LatentTable, decoder_of, encode
from .session import (
    SAVE,
    NetworkSession,
    checkpoint_interval,
    require_one_of,
    require_valid,
)

DIRECTIONS = "directions"
LATENTS = (*ENCODERS, "free", "modes", DIRECTIONS)


@dataclass(frozen=True)
class DecoderTraining:
    """Settings of the training of a decoder.

    r latent coordinates; `latent` "encoder" (LDM-sec4.1-encoder), "encoder-nsf" (NSF-encoder),
    "free" (LDMW-eq7), or those of POD "modes" in the norm of the loss, snapshots weighing as often
    as they are shown, which cost no encoder and are no unknowns, or of their "directions", all in
    one unit of length; an epoch shows every snapshot
    once, `batch` at a time, each time at `points` random points (0: all); of the time levels from
    `dense` on, a random one in `every`. Learning rates are those of a `schedule` over all epochs.

    jitter: snapshots are shown displaced along the directions, each time by new normal coordinates
    with standard deviations of up to this one. No snapshot says what the map is like in all
    directions: with jitter, dg/dxhat of the weak ones is that of the modes, and not of the error.
    """

    r: int
    hidden: tuple = HIDDEN
    latent: str = "encoder"
    weights: LossWeights = CODE
    epochs: int = 850
    batch: int = 8
    points: int = 0
    dense: int = 0
    every: int = 1
    seed: int = 0
    schedule: str = "cosine"
    jitter: float = 0.0

    def __post_init__(self):
        require_valid(self, ("r", "epochs", "batch", "every"), ("points", "dense", "jitter"))
        require_one_of("latent", self.latent, LATENTS)


class TrainedDecoder(NamedTuple):
    """A decoder, the latent coordinates of its training snapshots, and the history."""

    decoder: object         # `rom.fields.network.Decoder`
    xhat: np.ndarray        # (s, k + 1, r) latent coordinates of the training snapshots
    history: np.ndarray     # (epochs, 4) loss, and its terms, of each epoch
    cost: TrainingTime              # of all parts of the training


class DecoderSession(NetworkSession):
    """A decoder and its latent coordinates under training."""

    def __init__(self, settings, snapshots, device="cpu"):
        require_derivatives(settings, snapshots)
        s, levels, n, d = snapshots.x.shape
        digest = sha256(snapshots.dt, snapshots.X, snapshots.x, snapshots.F, snapshots.v)
        super().__init__(settings, digest, s * levels, n, device)
        self.units = decoder_units(snapshots)
        self.data = tensors_of(snapshots, self.units, device=device)
        self.level = torch.arange(self.snapshots) % levels
        self.f = FieldPerceptron(d, settings.r, settings.hidden)
        self.encoder = encoder_of(settings, snapshots)
        self.inputs = (self.data.standardised if settings.latent in ENCODERS
                       else torch.arange(self.snapshots, device=device))
        self.learn(f=self.f, encoder=self.encoder)

    def order(self):
        """Return every snapshot once, or those whose turn it is, at least one."""
        order = super().order()
        if self.settings.every > 1:
            turn = torch.rand(len(order), generator=self.random) * self.settings.every < 1.0
            shown = order[(turn | (self.level < self.settings.dense))[order]]
            order = shown if len(shown) else order[:1]
        return order

    def error(self, batch):
        """Return the loss of a batch of snapshots, and its terms."""
        points = self.draw_points()
        rows = batch_of(self.data, batch, points, self.latents)
        if self.settings.jitter:
            jitter = self.draw_jitter(len(batch), self.settings.r)
            rows = displace(rows, jitter, self.encoder.modes[points])
        return loss(self.f, rows, self.data.units, self.settings.weights)

    def latents(self, numbers):
        """Return the latent coordinates (s, r) of snapshots by number."""
        return self.encoder(self.inputs[numbers])

    def result(self, runs):
        """Return `TrainedDecoder` of this number of runs."""
        xhat = encode(self.encoder, self.inputs).cpu().double().numpy()
        return TrainedDecoder(decoder_of(self.f, self.units),
                              xhat.reshape(runs, -1, self.settings.r), np.array(self.history),
                              self.meter.total)


def displace(batch, y, modes):
    """Return a `Batch` of s snapshots at m points, displaced along modes (m, d, r) by coordinates
    y (s, r).
    """
    u = torch.einsum("mdr,sr->smd", modes, y).flatten(0, 1)
    return batch._replace(u=batch.u + u,
                          xhat=batch.xhat + y.repeat_interleave(len(modes), dim=0))


def require_derivatives(settings, snapshots):
    """Raise ValueError where a training asks for F and v of snapshots that have none."""
    asks = settings.weights.F or settings.weights.v or settings.latent == "modes"
    if snapshots.F is None and asks:
        raise ValueError(f"snapshots of positions alone, for latent = {settings.latent!r} and "
                         f"{settings.weights}: expected weights of 0, and other latents than modes")
    if settings.jitter and (settings.latent != DIRECTIONS or any(settings.weights)):
        raise ValueError(f"jitter = {settings.jitter:g}, with latent = {settings.latent!r} and "
                         f"{settings.weights}: expected latent = {DIRECTIONS!r} and weights of 0, "
                         "since only displacements are known between the snapshots")


def encoder_of(settings, snapshots):
    """Return the module that gives the latent coordinates of a training."""
    s, levels, n, d = snapshots.x.shape
    if settings.latent in ENCODERS:
        return Encoder(ENCODERS[settings.latent](d, n), settings.r)
    if settings.latent == "free":
        return LatentTable(s * levels, settings.r)
    if settings.latent == DIRECTIONS:
        modes, xhat = directions(snapshots.X, snapshots.x.reshape(s * levels, n, d), settings.r)
        return FixedLatents(xhat, modes)
    frequency = np.where(np.arange(levels) < settings.dense, 1.0, 1.0 / settings.every)
    return FixedLatents(basis(snapshots.X, *snapshots.flat(), settings.r, settings.weights.F,
                              np.tile(np.sqrt(frequency), s)).xhat)


def train_decoder(settings, snapshots, checkpoint=None, on_epoch=None, device="cpu"):
    """Return `TrainedDecoder` by `DecoderTraining` settings on the runs of `Snapshots`.

    checkpoint: a file to go on from and to save to; on_epoch(history) is called after each epoch;
    device: a `torch.device`, or its name. Raises `training.Diverged`.
    """
    session = train_epochs(DecoderSession(settings, snapshots, device), settings.epochs,
                           checkpoint_interval(settings.epochs, SAVE), checkpoint, on_epoch)
    return session.result(len(snapshots.x))
