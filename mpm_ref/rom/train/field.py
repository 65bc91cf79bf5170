"""Training a field on latent coordinates that are known and stay (NSF-sec4.5, stages 2 and 3).

    min_f mean over snapshots, points and values of ( f(X_p, xhat_n, mu) - y_np )^2

with standardised values y: of a stress its six independent values, each once. The public training
code of NSF's precursor takes 1000 times that, every second snapshot and a tenth of the points, and
parameters as they are; a constant factor changes nothing for Adam, and here mu is standardised.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import torch
from torch.nn.functional import mse_loss, pad

from ...training import Cost, train_epochs
from ..fields.network import Field
from ..snapshots import field_units
from . import session
from .perceptron import Perceptron, weights_of
from .session import SAVE, require_sound, saving, sha256


@dataclass(frozen=True)
class FieldTraining:
    """How a field is trained.

    `follows`: it depends on the parameters of a run too (NSF-mu-dep). An epoch shows every snapshot
    once, `batch` at a time, each time at `points` random points (0: all). Learning rates are those
    of a `schedule` over all epochs. beside: values are shown at latent coordinates near theirs,
    each time at others, with normal differences of standard deviations up to this one: it smooths.
    octaves: of the `features` of places.
    """

    hidden: tuple
    follows: bool = False
    epochs: int = 3000
    batch: int = 32
    points: int = 0
    seed: int = 0
    schedule: str = "steps"
    beside: float = 0.0
    octaves: int = 0

    def __post_init__(self):
        require_sound(self, ("epochs", "batch"), ("points", "beside", "octaves"))


class Observed(NamedTuple):
    """Values of a field in s runs of n points, and what it is a function of."""

    X: np.ndarray           # (n, d)            points at rest [m]
    xhat: np.ndarray        # (s, k + 1, r)     latent coordinates
    mu: np.ndarray          # (s, q)            parameters
    values: np.ndarray      # (s, k + 1, n, k)  need not be in memory
    dt: float               #                   length of a step [s]


class Fitted(NamedTuple):
    """A trained field."""

    field: Field
    history: np.ndarray     # (epochs,) mean squared error of standardised values in each epoch
    cost: Cost              # of all parts of the training


class Session(session.Session):
    """A field under training."""

    def __init__(self, training, observed, device="cpu"):
        runs, levels, n, k = observed.values.shape
        super().__init__(training, sha256(observed.dt, observed[:4]), runs * levels, n, device)
        mu = observed.mu[:, :observed.mu.shape[1] if training.follows else 0]
        self.units = field_units(observed.X, observed.values, mu)
        self.X = self.single((observed.X - self.units.low) / self.units.span)
        scaled = np.repeat((mu - self.units.mu_mean) / self.units.mu_std, levels, axis=0)
        xhat = observed.xhat.reshape(runs * levels, -1)
        self.states, self.r = self.single(np.hstack([xhat, scaled])), xhat.shape[1]
        self.values = observed.values.reshape(runs * levels, n, k)
        d, inputs = observed.X.shape[1], self.states.shape[1]
        self.f = Perceptron(d, inputs, training.hidden, k, training.octaves)
        self.learn(f=self.f)

    def error(self, at):
        """Mean squared error of a batch of snapshots; it has no terms."""
        points, states = self.some_points(), self.states[at]
        if self.training.beside:
            states = states + pad(self.away(len(at), self.r), (0, states.shape[1] - self.r))
        found = self.f(self.X[points].repeat(len(at), 1),
                       states.repeat_interleave(len(points), dim=0))
        return mse_loss(found, self.standardised(at, points)), ()

    def standardised(self, at, points):
        """Values (s m, k) of snapshots at points, in the field's units."""
        values = self.values[at.numpy()[:, None], points.numpy()]
        return self.single((values - self.units.mean) / self.units.std).flatten(0, 1)

    def single(self, a):
        """An array as a tensor of single precision."""
        return torch.as_tensor(a, dtype=torch.float32, device=self.device)

    def result(self):
        """`Fitted`."""
        trained = Field(weights_of(self.f), self.units, self.training.octaves)
        return Fitted(trained, np.array(self.history)[:, 0], self.meter.total)


def train(training, observed, checkpoint=None, on_epoch=None, device="cpu"):
    """`Fitted` to `Observed` values; checkpoint, on_epoch and device as for `fit.train`.

    Raises ValueError where values are not finite, `session.Diverged` where a loss is not.
    """
    done = train_epochs(Session(training, observed, device), training.epochs,
                                saving(training.epochs, SAVE), checkpoint, on_epoch)
    return done.result()
