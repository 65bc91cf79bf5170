"""Laws trained on the true stresses and strains, the paper's oracle "labeled" (NCLAW-methods).

Each point at each step of a recorded run gives pairs (F, tau) and (trial F, F). The authors'
release sets 30 epochs, batches of 1000 pairs and rates of 0.1; schedule and clipping of gradients
are those of `fit`. Neither text nor release says what is minimised: here the mean squared error of
all components, of tau in Pa. Pairs come in a new random order each epoch.
"""

from typing import NamedTuple

import numpy as np
import torch

from ...core import deform
from ...materials import NoFlow
from ...training import Diverged, train_epochs
from .fit import SAVE, Epoch, TrajectorySession
from .identified_laws import axes, particles

BATCH = 1000        # pairs


class Labels(NamedTuple):
    """Inputs and true outputs of laws at all points and steps; (pairs, d, d), in doubles."""

    F: torch.Tensor
    tau: torch.Tensor       # [Pa] of F
    trial: torch.Tensor
    F_new: torch.Tensor     # of trial


def labels_of(observed, law, dt):
    """Return the `Labels` of a `Trajectory` of an elastic law, steps of MLS-MPM of dt [s]."""
    shape = observed.F.shape[2:]
    F, F_new, C = (a.reshape(-1, *shape) for a in (observed.F[:-1], observed.F[1:], observed.C[1:]))
    q = particles(F.numpy(), np.zeros(F.shape))
    deform.initial_stress(q, law, NoFlow(), axes(F))
    return Labels(F, torch.from_numpy(q.tau), F + dt * C @ F, F_new)


class LabeledSession(TrajectorySession):
    """Laws, optimisers and schedules of a training on `Labels`."""

    errors_of = "F"

    def epoch(self):
        """Show all pairs once."""
        number, count = len(self.history), len(self.observed.F)
        draws = torch.Generator().manual_seed(self.recipe.seed + number)
        batches = torch.randperm(count, generator=draws).split(BATCH)
        rows = [self.learn(Labels(*(a[batch] for a in self.observed))) for batch in batches]
        for schedule in self.schedules:
            schedule.step()
        losses, steepness = zip(*rows, strict=True)
        elastic, plastic = np.mean(losses, axis=0).tolist()
        self.history.append(Epoch(elastic, plastic, len(batches), steepness[-1]))

    def learn(self, labels):
        """Make a step of each optimiser; return the mean squared errors of tau [Pa^2] and of F,
        and the norms of the gradients.
        """
        for optimiser in self.optimisers:
            optimiser.zero_grad()
        losses = [((law(F) - label) ** 2).mean() for law, F, label in
                  zip(self.laws, (labels.F, labels.trial), (labels.tau, labels.F_new), strict=True)]
        if not all(map(torch.isfinite, losses)):
            raise Diverged(f"epoch {self.number}: the loss is "
                           f"{[loss.item() for loss in losses]}; try smaller rates")
        sum(losses).backward()
        steepness = tuple(self.cut_gradients())
        for optimiser in self.optimisers:
            optimiser.step()
        return [loss.item() for loss in losses], steepness


def train_labeled(recipe, laws, world, labels, checkpoint=None, on_epoch=None):
    """Train laws in place on `Labels` of a `World` and return the session, like `fit.train`. The
    `loss` of an epoch is the mean squared error of tau [Pa^2], its `error` that of F.
    """
    session = LabeledSession(recipe, laws, world, labels)
    return train_epochs(session, recipe.epochs, SAVE, checkpoint, on_epoch)
