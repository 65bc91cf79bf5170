"""The learned deformation map g(X; xhat), with F and the velocity as its derivatives.

    g(X; xhat)  = X + mean + std f((X - low) / span, xhat)                     LDM-eq14, LDM-appB
    F           = I + diag(std) df/dX diag(1/span)                             LDM-eq15
    dg/dxhat    = diag(std) df/dxhat                                           LDM-eq16

f is a perceptron of the scaled reference position and the latent coordinates; its outputs are
standardised displacements. The box low .. low + span is that of the body at rest, mean and std are
those of the training data alone.
"""

from typing import NamedTuple

import numpy as np

from ..core.jit import CHUNKS, chunk, kernel, parallel, prange
from .network import Network, pull_back, push_forward, value


class Decoder(NamedTuple):
    """A perceptron, and the units of what goes in and comes out; d axes."""

    net: Network        # sizes (d + r, .., d)
    low: np.ndarray     # (d,) corner of the body's box at rest [m]
    span: np.ndarray    # (d,) its sides [m]
    mean: np.ndarray    # (d,) of the displacement [m]
    std: np.ndarray     # (d,) [m]

    @property
    def dim(self):
        """Number of axes d."""
        return self.net.sizes[-1]

    @property
    def r(self):
        """Number of latent coordinates."""
        return self.net.sizes[0] - self.dim

    def place(self, X, xhat):
        """x = g(X; xhat) of points X (n, d) [m]."""
        x = np.empty(X.shape)
        _place_all(self, X, xhat, x, *_scratch(self.net))
        return x

    def derivatives(self, X, xhat):
        """x (n, d) [m], F (n, d, d) and dg/dxhat (n, d, r) [m] of points X (n, d)."""
        n, d = X.shape
        x, F, G = np.empty((n, d)), np.empty((n, d, d)), np.empty((n, d, self.r))
        _derivatives_all(self, X, xhat, (x, F, G), *_scratch(self.net))
        return x, F, G

    def velocity(self, X, xhat, vhat):
        """dg/dxhat(X; xhat) vhat of points X (n, d) [m/s]."""
        v = np.empty(X.shape)
        _velocity_all(self, X, xhat, vhat, v, *_scratch(self.net))
        return v


def _scratch(net):
    """Activations, and two rows, for every chunk."""
    return (np.empty((CHUNKS, len(net.sizes), max(net.sizes))),
            np.empty((CHUNKS, 2, max(net.sizes))))


@kernel
def inputs(map, X, xhat, p, a):
    """Scaled reference position and latent coordinates, into a."""
    d = len(map.low)
    for k in range(d):
        a[k] = (X[p, k] - map.low[k]) / map.span[k]
    a[d:d + len(xhat)] = xhat


@kernel
def output(map, X, p, y, x):
    """x_p = X_p + mean + std y."""
    for k in range(len(map.low)):
        x[p, k] = X[p, k] + map.mean[k] + map.std[k] * y[k]


@kernel
def place(map, X, xhat, x, a, bounds):
    """x_p = g(X_p; xhat)."""
    for p in range(bounds[0], bounds[1]):
        inputs(map, X, xhat, p, a[0])
        value(map.net, a)
        output(map, X, p, a[-1], x)


@kernel
def derivatives(map, X, xhat, out, a, rows, bounds):
    """x_p, F_p = I + diag(std) df/dX diag(1/span), G_p = diag(std) df/dxhat."""
    x, F, G = out
    d = len(map.low)
    for p in range(bounds[0], bounds[1]):
        inputs(map, X, xhat, p, a[0])
        value(map.net, a)
        output(map, X, p, a[-1], x)
        for k in range(d):
            u = rows[0]
            pull_back(map.net, a, k, u, rows[1])
            for l in range(d):
                F[p, k, l] = map.std[k] * u[l] / map.span[l] + (1.0 if k == l else 0.0)
            for l in range(len(xhat)):
                G[p, k, l] = map.std[k] * u[d + l]


@kernel
def velocity(map, X, xhat, vhat, v, a, rows, bounds):
    """v_p = dg/dxhat(X_p; xhat) vhat."""
    d = len(map.low)
    for p in range(bounds[0], bounds[1]):
        inputs(map, X, xhat, p, a[0])
        value(map.net, a)
        rows[0, :d] = 0.0
        rows[0, d:d + len(vhat)] = vhat
        push_forward(map.net, a, rows[0], rows[1])
        for k in range(d):
            v[p, k] = map.std[k] * rows[0, k]


@parallel
def _place_all(map, X, xhat, x, a, rows):
    for c in prange(CHUNKS):
        place(map, X, xhat, x, a[c], chunk(c, len(X)))


@parallel
def _derivatives_all(map, X, xhat, out, a, rows):
    for c in prange(CHUNKS):
        derivatives(map, X, xhat, out, a[c], rows[c], chunk(c, len(X)))


@parallel
def _velocity_all(map, X, xhat, vhat, v, a, rows):
    for c in prange(CHUNKS):
        velocity(map, X, xhat, vhat, v, a[c], rows[c], chunk(c, len(X)))
