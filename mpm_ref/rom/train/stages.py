"""NSF's training, in three stages (NSF-sec4.5).

First position and encoder, from the error of positions alone; then the stress, and last the affine
field, with the latent coordinates of the first stage, which stay as they are.
"""

from functools import partial
from pathlib import Path
from typing import NamedTuple

from ..fields.architecture import hidden
from ..fields_file import Model
from ..snapshots import Snapshots
from . import decoder, field
from .decoder import Trained, Training
from .field import FieldTraining, Fitted, Observed
from .loss import Weights
from .schedule import PRINTED

POSITION = Weights(0.0, 0.0)        # of the error of F and of the velocity: neither is in the loss
EPOCHS, FIELD_EPOCHS = 300, 600     # for each of the printed rates (NSF-train)


class Plan(NamedTuple):
    """How the three networks are trained."""

    g: Training
    h: FieldTraining
    l: FieldTraining


class Stages(NamedTuple):
    """Three trained networks."""

    g: Trained
    h: Fitted
    l: Fitted

    def model(self, about):
        """The `Model` to be stored; about: what is to be known of it, plain values. Runs begin
        their search near the mean of the runs' first latent coordinates.
        """
        xhat = self.g.xhat
        return Model(self.g.decoder, self.h.field, self.l.field, xhat, xhat[:, 0].mean(axis=0),
                     about)


def printed(dim, r, betas, follows=False):
    """The paper's `Plan` for d = dim, r latent coordinates and the factors of width of g, h and l
    (NSF-arch, NSF-train).

    The epochs are read as those for each learning rate; they could be meant in total. The public
    training code of NSF's precursor trains for 750 epochs and 2700.
    """
    widths = [hidden(beta, k) for beta, k in
              zip(betas, (dim, dim * (dim + 1) // 2, dim * dim), strict=True)]
    epochs = FIELD_EPOCHS * len(PRINTED)
    return Plan(Training(r, widths[0], "encoder-nsf", POSITION, EPOCHS * len(PRINTED), 32,
                         schedule="steps"),
                FieldTraining(widths[1], follows, epochs), FieldTraining(widths[2], epochs=epochs))


def train(plan, histories, folder=None, on_epoch=None, device="cpu"):
    """`Stages` of a `Plan` on `Histories`.

    folder: where each stage goes on from its checkpoint and saves it, a stage that is done too;
    on_epoch(stage, history) is called after each epoch; device as for `decoder.train`. Raises
    ValueError where data are not finite, `session.Diverged` where a loss is not.
    """
    def asked(name):
        return (None if folder is None else Path(folder) / f"{name}.pt",
                None if on_epoch is None else partial(on_epoch, name), device)

    g = decoder.train(plan.g, positions(histories), *asked("g"))
    known = Observed(histories.X, g.xhat, histories.mu, histories.tau, histories.dt)
    h = field.train(plan.h, known, *asked("h"))
    l = field.train(plan.l, known._replace(values=histories.C), *asked("l"))
    return Stages(g, h, l)


def positions(histories):
    """The `Snapshots` of `Histories`: positions alone."""
    return Snapshots(histories.X, histories.m, histories.V0, histories.mu, histories.x, None, None,
                     histories.dt)
