"""The learned deformation map g(X; xhat), with F and the velocity as its derivatives.

    g(X; xhat)  = X + mean + std f((X - low) / span, xhat)                     LDM-eq14, LDM-appB
    F           = I + diag(std) df/dX diag(1/span)                             LDM-eq15
    dg/dxhat    = diag(std) df/dxhat                                           LDM-eq16

f is a perceptron of the scaled reference position and the latent coordinates; its outputs are
standardised displacements, where the paper says positions: F is I plus what is learned. The box
low .. low + span is that of the body at rest, mean and std are those of the training data alone.
"""

from typing import NamedTuple

import numpy as np

from .batch import backward, directional, forward, over
from .features import count, features
from .network import Network, layers_of


class Units(NamedTuple):
    """What a decoder's inputs and outputs are measured in; d axes."""

    low: np.ndarray     # (d,) corner of the body's box at rest [m]
    span: np.ndarray    # (d,) its sides [m]
    mean: np.ndarray    # (d,) of the displacement [m]
    std: np.ndarray     # (d,) of the displacement [m]


class Decoder(NamedTuple):
    """A learned map: a perceptron with sizes (d + r, .., d), and its units."""

    net: Network
    units: Units

    @property
    def dim(self):
        """Number of axes d."""
        return int(self.net.sizes[-1])

    @property
    def r(self):
        """Number of latent coordinates."""
        return int(self.net.sizes[0]) - self.dim

    def place(self, X, xhat):
        """x = g(X; xhat) of points X (n, d) [m]."""
        return X + self.units.mean + self.units.std * outputs(*self, X, xhat)

    def derivatives(self, X, xhat):
        """x (n, d), F (n, d, d) and dg/dxhat (n, d, r) [m] of points X (n, d)."""
        (n, d), layers = X.shape, layers_of(self.net)
        y, dy = np.empty((n, d)), np.empty((n, d, d + self.r))

        def work(rows):
            y[rows], slopes = forward(layers, inputs(*self, X[rows], xhat))
            for k in range(d):
                dy[rows, k] = backward(layers, slopes, k)

        over(n, work)
        dy *= self.units.std[:, None]
        return (X + self.units.mean + self.units.std * y,
                np.eye(d) + dy[..., :d] / self.units.span, np.ascontiguousarray(dy[..., d:]))

    def velocity(self, X, xhat, vhat):
        """dg/dxhat(X; xhat) vhat of points X (n, d) [m/s]."""
        layers, v = layers_of(self.net), np.empty(X.shape)
        along = np.concatenate([np.zeros(self.dim), vhat]).astype(self.net.W.dtype)

        def work(rows):
            _, slopes = forward(layers, inputs(*self, X[rows], xhat))
            v[rows] = directional(layers, slopes, along)

        over(len(X), work)
        return self.units.std * v

    def single(self):
        """The same map, its network in single precision: faster, with errors of round-off of the
        displacements, below which `inverse` finds nothing.
        """
        net = self.net
        return self._replace(net=Network(net.sizes, *(a.astype(np.float32) for a in net[1:])))


def inputs(net, units, X, y, octaves=0):
    """What a network takes of points X (n, d): scaled positions at rest, or their `features`, and
    the coordinates y of the state, which are the same for all; (n, d (1 + 2 octaves) + len(y)).
    """
    k = count(len(units.low), octaves)
    A = np.empty((len(X), net.sizes[0]), dtype=net.W.dtype)
    A[:, :k] = features((X - units.low) / units.span, octaves)
    A[:, k:] = y
    return A


def outputs(net, units, X, y, octaves=0):
    """Standardised outputs (n, k) of a network at points X (n, d) and coordinates y."""
    layers, found = layers_of(net), np.empty((len(X), net.sizes[-1]))

    def work(rows):
        found[rows] = forward(layers, inputs(net, units, X[rows], y, octaves))[0]

    over(len(X), work)
    return found
