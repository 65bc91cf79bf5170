"""A learned field over the material points of a body: stress or affine velocity (NSF-eq9,
NSF-sec4.4).

    values(X; xhat, mu) = mean + std f(Z, xhat, (mu - mu_mean) / mu_std),    Z = (X - low) / span

f is a perceptron with standardised outputs, of Z or of the `features` of Z. The field may depend on
the problem's parameters mu beside the latent coordinates (NSF-mu-dep): where runs with different
parameters start from the same state, xhat cannot tell them apart. What the values are of is not
known here; see `symmetric` for those of a stress.
"""

from typing import NamedTuple

import numpy as np

from .decoder import outputs
from .features import count
from .network import Network
from .snapshots import measures


class FieldUnits(NamedTuple):
    """What a field's inputs and outputs are measured in; d axes, k values, q parameters."""

    low: np.ndarray         # (d,) corner of the body's box at rest [m]
    span: np.ndarray        # (d,) its sides [m]
    mean: np.ndarray        # (k,) of the values
    std: np.ndarray         # (k,) of the values
    mu_mean: np.ndarray     # (q,) of the parameters
    mu_std: np.ndarray      # (q,) of the parameters


class Field(NamedTuple):
    """A perceptron with sizes (d (1 + 2 octaves) + r + q, .., k), and its units."""

    net: Network
    units: FieldUnits
    octaves: int = 0        # of `features`

    @property
    def dim(self):
        """Number of axes d."""
        return len(self.units.low)

    @property
    def parameters(self):
        """Number q of parameters that it depends on."""
        return len(self.units.mu_mean)

    @property
    def r(self):
        """Number of latent coordinates."""
        return int(self.net.sizes[0]) - count(self.dim, self.octaves) - self.parameters

    @property
    def outputs(self):
        """Number k of values."""
        return int(self.net.sizes[-1])

    def own(self, mu):
        """Those of a run's parameters mu that it depends on: all, or none."""
        return mu if self.parameters else ()

    def values(self, X, xhat, mu=()):
        """Values (n, k) at points X (n, d) [m]. Raises ValueError as `coordinates` does."""
        y = outputs(self.net, self.units, X, self.coordinates(xhat, mu), self.octaves)
        return self.units.mean + self.units.std * y

    def coordinates(self, xhat, mu=()):
        """Latent coordinates and normalised parameters (r + q,), as the network takes them. Raises
        ValueError for another number of either.
        """
        if np.shape(xhat) != (self.r,) or np.shape(mu) != (self.parameters,):
            raise ValueError(f"xhat of shape {np.shape(xhat)} and mu of shape {np.shape(mu)}: "
                             f"expected ({self.r},) and ({self.parameters},), as the field was "
                             "trained with")
        return np.concatenate([xhat, (np.asarray(mu, dtype=float) - self.units.mu_mean)
                               / self.units.mu_std])


def field_units(X, values, mu):
    """`FieldUnits` of points X (n, d) with training values (s, levels, n, k), of s runs with
    parameters mu (s, q) that the field depends on. Runs are looked at one by one, so that they need
    not be in memory. A value that hardly varies is measured like the one that varies most, a
    parameter that does not vary in 1. Raises ValueError where a run is not finite.
    """
    for k, run in enumerate(values):
        if not np.isfinite(run).all():
            raise ValueError(f"run {k}: the training values are not all finite; generate it again")
    mean = np.mean([run.mean(axis=(0, 1), dtype=float) for run in values], axis=0)
    square = np.mean([np.mean((run - mean) ** 2, axis=(0, 1)) for run in values], axis=0)
    largest = max(np.abs(run).max() for run in values)
    mu_std = [measures(own.std(keepdims=True), np.abs(own).max())[0] for own in mu.T]
    return FieldUnits(X.min(axis=0), np.ptp(X, axis=0), mean, measures(np.sqrt(square), largest),
                      mu.mean(axis=0), np.array(mu_std))
