"""Training of laws on one trajectory: segments, schedule, cut gradients, history (NCLAW-eq5)."""

import hashlib
import json
from dataclasses import asdict
from typing import NamedTuple

import torch

from ...training import Diverged, TrainingSession, train_epochs
from .neural_laws import describe
from .rollout import segment_errors

SAVE = 5            # epochs between checkpoints
FORMAT = 2          # of checkpoints
ADVICE = "Try smaller rates, a smaller unit or shorter horizons"


class Epoch(NamedTuple):
    """The errors and gradients of an epoch."""

    loss: float         # as it is trained on
    error: float        # mean squared error of positions after a step [m^2]
    segments: int
    steepness: tuple    # norms of the gradients, elastic and plastic


class TrajectorySession(TrainingSession):
    """Laws, optimisers and schedules of a training under way."""

    entry = Epoch._make
    errors_of = "positions"         # quantity of the errors of epochs

    def __init__(self, recipe, laws, world, observed):
        super().__init__()
        self.recipe, self.laws, self.world, self.observed = recipe, laws, world, observed
        self.digest = data_digest(world, observed)
        rates = recipe.elastic_rate, recipe.plastic_rate
        learned = [(list(law.parameters()), rate) for law, rate in zip(laws, rates, strict=True)]
        self.parameters = [own for own, _ in learned]
        self.optimisers = [torch.optim.Adam(own, lr=rate) for own, rate in learned if own]
        self.schedules = [torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, recipe.epochs)
                          for optimiser in self.optimisers]

    @property
    def number(self):
        """Return the number of the epoch under way, counted from 1."""
        return len(self.history) + 1

    @property
    def description(self):
        """Return the settings, what is trained and on what, as one line of text; without those with
        which only time, memory and round-off change, and without a term of the loss that is not in
        it (checkpoints of before do not know `idempotence`).
        """
        recipe = {name: value for name, value in asdict(self.recipe).items()
                  if name not in ("batch", "keep_every") and (name != "idempotence" or value)}
        if self.recipe.velocity:        # an error without a name has velocities in it
            recipe["errors_of"] = self.errors_of
        return json.dumps({"format": FORMAT, **recipe, "laws": [*map(describe, self.laws)],
                           "data": self.digest})

    @property
    def errors(self):
        """Return the errors of all epochs and their quantity: plain values, for an `about`."""
        return {"errors": [epoch.error for epoch in self.history], "errors_of": self.errors_of}

    def epoch(self):
        """Run the trajectory once, in segments, and make a step of each optimiser."""
        steps, number = len(self.observed.x) - 1, len(self.history)
        asked = self.recipe.teacher.restarts(steps, number, self.recipe.epochs)
        cuts = self.observed.restarts(asked)
        weight = self.recipe.weight(len(cuts) - 1, steps)
        for optimiser in self.optimisers:
            optimiser.zero_grad()
        shown = [self.show(cuts[k:k + self.recipe.batch + 1], weight)
                 for k in range(0, len(cuts) - 1, self.recipe.batch)]
        loss, error = map(sum, zip(*shown, strict=True))
        steepness = tuple(self.cut_gradients())
        for optimiser, schedule in zip(self.optimisers, self.schedules, strict=True):
            optimiser.step()
            schedule.step()
        self.history.append(Epoch(weight * loss, error / cuts[-1], len(cuts) - 1, steepness))

    def show(self, cuts, weight):
        """Add the gradients of some segments; return their loss, not yet weighted, and its part of
        the positions.
        """
        try:
            errors = segment_errors(self.laws, self.world, self.observed, cuts[:-1], cuts[1:],
                                    self.recipe)
        except ValueError as fault:
            raise Diverged(f"epoch {self.number}, steps {cuts[0]} to {cuts[-1]}: {fault} {ADVICE}"
                           ) from None
        if not torch.isfinite(errors.loss):
            raise Diverged(f"epoch {self.number}, steps {cuts[0]} to {cuts[-1]}: the loss is "
                           f"{errors.loss.item()}. {ADVICE}")
        if errors.loss.requires_grad:
            (weight * errors.loss).backward()
        return errors.loss.item(), errors.positions.item()

    def cut_gradients(self):
        """Clip the gradients of each law; yield their norm before."""
        for own in self.parameters:
            norm = torch.nn.utils.clip_grad_norm_(own, self.recipe.clip).item() if own else 0.0
            if not norm < float("inf"):
                raise Diverged(f"epoch {self.number}: a gradient of norm {norm}. {ADVICE}")
            yield norm

    def states(self):
        """Return the laws, optimisers and schedules, of which a checkpoint has the states."""
        return {"laws": self.laws, "optimisers": self.optimisers, "schedules": self.schedules}


def data_digest(world, observed):
    """Return the sha256 of the training data."""
    digest = hashlib.sha256(repr((world.dx, world.dt, world.eps)).encode())
    for a in (*world[2:3], *world[4:]):
        digest.update(repr(a.shape).encode() + a.tobytes())
    for a in observed:
        digest.update(repr(tuple(a.shape)).encode() + a.numpy().tobytes())
    return digest.hexdigest()


def train(recipe, laws, world, observed, checkpoint=None, on_epoch=None):
    """Train a `LawPair` in place on `observations`; return the `TrajectorySession`.

    checkpoint: a file to go on from and to save to; on_epoch(history) is called after each epoch.
    Raises `Diverged`, with the epoch and the steps.
    """
    session = TrajectorySession(recipe, laws, world, observed)
    return train_epochs(session, recipe.epochs, SAVE, checkpoint, on_epoch)
