"""Training of a field on given, fixed latent coordinates (NSF-sec4.5, stages 2 and 3).

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

from ...training import TrainingTime, sha256, train_epochs
from ..fields.network import Field
from ..snapshots import field_units
from .networks import FieldPerceptron, network_of
from .session import SAVE, NetworkSession, checkpoint_interval, on_processor, require_valid


@dataclass(frozen=True)
class FieldTraining:
    """Settings of the training of a field.

    `follows`: it depends on the parameters of a run too (NSF-mu-dep). An epoch shows every snapshot
    once, `batch` at a time, each time at `points` random points (0: all). Learning rates are those
    of a `schedule` over all epochs. jitter: values are shown at latent coordinates near theirs,
    each time at new ones, with normal differences of standard deviations of up to this one: it
    smooths. octaves: number of Fourier features of places (see `fields.perceptron`).
    """

    hidden: tuple
    follows: bool = False
    epochs: int = 3000
    batch: int = 32
    points: int = 0
    seed: int = 0
    schedule: str = "steps"
    jitter: float = 0.0
    octaves: int = 0

    def __post_init__(self):
        require_valid(self, ("epochs", "batch"), ("points", "jitter", "octaves"))


class FieldData(NamedTuple):
    """Values of a field in s runs of n points, and the variables that it is a function of."""

    X: np.ndarray           # (n, d)            points at rest [m]
    xhat: np.ndarray        # (s, k + 1, r)     latent coordinates
    mu: np.ndarray          # (s, q)            parameters
    values: np.ndarray      # (s, k + 1, n, k)  on a processor they need not be in memory
    dt: float               #                   length of a step [s]


class TrainedField(NamedTuple):
    """A trained field and its history."""

    field: Field
    history: np.ndarray     # (epochs,) mean squared error of standardised values in each epoch
    cost: TrainingTime              # of all parts of the training


class FieldSession(NetworkSession):
    """A field under training."""

    def __init__(self, settings, data, device="cpu"):
        runs, levels, n, k = data.values.shape
        super().__init__(settings, sha256(*data), runs * levels, n, device)
        mu = data.mu[:, :data.mu.shape[1] if settings.follows else 0]
        self.units = field_units(data.X, data.values, mu)
        self.X = self.single((data.X - self.units.low) / self.units.span)
        scaled = np.repeat((mu - self.units.mu_mean) / self.units.mu_std, levels, axis=0)
        xhat = data.xhat.reshape(runs * levels, -1)
        self.variables, self.r = self.single(np.hstack([xhat, scaled])), xhat.shape[1]
        self.values = data.values.reshape(runs * levels, n, k)
        self.stored = None if on_processor(device) else self.standardised(self.values)
        d, inputs = data.X.shape[1], self.variables.shape[1]
        self.f = FieldPerceptron(d, inputs, settings.hidden, k, settings.octaves)
        self.learn(f=self.f)

    def error(self, batch):
        """Return the mean squared error of a batch of snapshots; it has no terms."""
        points, states = self.draw_points(), self.variables[batch]
        if self.settings.jitter:
            jitter = self.draw_jitter(len(batch), self.r)
            states = states + pad(jitter, (0, states.shape[1] - self.r))
        y = self.f(self.X[points].repeat(len(batch), 1),
                   states.repeat_interleave(len(points), dim=0))
        return mse_loss(y, self.values_at(batch, points).flatten(0, 1)), ()

    def values_at(self, batch, points):
        """Return the values (s, m, k) of snapshots at points, in the field's units."""
        if self.stored is not None:
            return self.stored[batch[:, None], points]
        return self.standardised(self.values[batch.numpy()[:, None], points.numpy()])

    def standardised(self, values):
        """Return values in the field's units, as a tensor."""
        return self.single((values - self.units.mean) / self.units.std)

    def single(self, a):
        """Return an array as a tensor of single precision."""
        return torch.as_tensor(a, dtype=torch.float32, device=self.device)

    def result(self):
        """Return the `TrainedField`."""
        field = Field(network_of(self.f), self.units, self.settings.octaves)
        return TrainedField(field, np.array(self.history)[:, 0], self.meter.total)


def train_field(settings, data, checkpoint=None, on_epoch=None, device="cpu"):
    """Return `TrainedField` by `FieldTraining` settings on `FieldData`; checkpoint, on_epoch and
    device as for `decoder.train_decoder`.

    Raises ValueError where values are not finite, `training.Diverged` where a loss is not.
    """
    session = train_epochs(FieldSession(settings, data, device), settings.epochs,
                           checkpoint_interval(settings.epochs, SAVE), checkpoint, on_epoch)
    return session.result()
