"""Training of NSF's three networks, in three stages (NSF-sec4.5).

First position and encoder, from the error of positions alone; then the stress, and last the affine
field, with the latent coordinates of the first stage, which stay as they are.
"""

from functools import partial
from pathlib import Path
from typing import NamedTuple

from ..fields.architecture import hidden
from ..fields.network import Networks
from ..model_file import Model
from ..snapshots import Snapshots
from .decoder import DecoderTraining, TrainedDecoder, train_decoder
from .field import FieldData, FieldTraining, TrainedField, train_field
from .loss import LossWeights
from .schedule import PRINTED

POSITION = LossWeights(0.0, 0.0)    # of the error of F and of the velocity: neither is in the loss
EPOCHS, FIELD_EPOCHS = 300, 600     # for each of the printed rates (NSF-train)


class StagePlan(NamedTuple):
    """Settings of the training of the three networks."""

    g: DecoderTraining
    h: FieldTraining
    l: FieldTraining


class TrainedStages(NamedTuple):
    """Three trained networks."""

    g: TrainedDecoder
    h: TrainedField
    l: TrainedField

    def model(self, about):
        """Return the `Model` to be stored; about: plain values that describe it. Runs begin their
        search near the mean of the training runs' first latent coordinates.
        """
        xhat = self.g.xhat
        fields = Networks(self.g.decoder, self.h.field, self.l.field)
        return Model(fields, xhat, xhat[:, 0].mean(axis=0), about)


def printed_plan(dim, r, betas, follows=False):
    """Return the paper's `StagePlan` for d = dim, r latent coordinates and the factors of width of
    g, h and l (NSF-arch, NSF-train).

    The epochs are read as those for each learning rate; they could be meant in total. The public
    training code of NSF's precursor trains for 750 epochs and 2700.
    """
    widths = [hidden(beta, k) for beta, k in
              zip(betas, (dim, dim * (dim + 1) // 2, dim * dim), strict=True)]
    epochs = FIELD_EPOCHS * len(PRINTED)
    g = DecoderTraining(r, widths[0], "encoder-nsf", POSITION, EPOCHS * len(PRINTED), 32,
                        schedule="steps")
    return StagePlan(g, FieldTraining(widths[1], follows, epochs),
                     FieldTraining(widths[2], epochs=epochs))


def train_stages(plan, histories, folder=None, on_epoch=None, device="cpu"):
    """Return `TrainedStages` of a `StagePlan` on `Histories`.

    folder: where each stage goes on from its checkpoint and saves it, a stage that is done too;
    on_epoch(stage, history) is called after each epoch; device as for `train_decoder`. Raises
    ValueError where data are not finite, `training.Diverged` where a loss is not.
    """
    def options(name):
        return (None if folder is None else Path(folder) / f"{name}.pt",
                None if on_epoch is None else partial(on_epoch, name), device)

    g = train_decoder(plan.g, position_snapshots(histories), *options("g"))
    data = FieldData(histories.X, g.xhat, histories.mu, histories.tau, histories.dt)
    h = train_field(plan.h, data, *options("h"))
    l = train_field(plan.l, data._replace(values=histories.C), *options("l"))
    return TrainedStages(g, h, l)


def position_snapshots(histories):
    """Return the `Snapshots` of `Histories`, with positions alone."""
    return Snapshots(histories.X, histories.m, histories.V0, histories.mu, histories.x, None, None,
                     histories.dt)
