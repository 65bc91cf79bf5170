"""The learned map point by point: one backward pass for every output of every point.

The plain twin of `decoder`, compiled: no more memory than a point needs, and no library below it.
"""

import numpy as np

from ..core.jit import CHUNKS, chunk, kernel, parallel, prange
from .network import pull_back, push_forward, value


def places(map, X, xhat):
    """x = g(X; xhat) of points X (n, d) [m]."""
    x = np.empty(X.shape)
    _place_all(*map, (X, xhat), x, scratch(map.net))
    return x


def derivatives(map, X, xhat):
    """x (n, d), F (n, d, d) and dg/dxhat (n, d, r) [m] of points X (n, d)."""
    n, d = X.shape
    x, F, G = np.empty((n, d)), np.empty((n, d, d)), np.empty((n, d, map.r))
    _derivatives_all(*map, (X, xhat), (x, F, G), scratch(map.net))
    return x, F, G


def velocities(map, X, xhat, vhat):
    """dg/dxhat(X; xhat) vhat of points X (n, d) [m/s]."""
    v = np.empty(X.shape)
    _velocity_all(*map, (X, xhat, vhat), v, scratch(map.net))
    return v


def scratch(net):
    """Activations of all layers, and two rows more, for every chunk."""
    return np.empty((CHUNKS, len(net.sizes) + 2, net.sizes.max()))


@kernel
def inputs(units, X, xhat, p, a):
    """Scaled reference position and latent coordinates, into a."""
    d = len(units.low)
    for k in range(d):
        a[k] = (X[p, k] - units.low[k]) / units.span[k]
    a[d:d + len(xhat)] = xhat


@kernel
def output(units, X, p, y, x):
    """x_p = X_p + mean + std y."""
    for k in range(len(units.low)):
        x[p, k] = X[p, k] + units.mean[k] + units.std[k] * y[k]


@kernel
def place(net, units, at, x, a, bounds):
    """x_p = g(X_p; xhat), at = (X, xhat)."""
    X, xhat = at
    for p in range(bounds[0], bounds[1]):
        inputs(units, X, xhat, p, a[0])
        value(net, a)
        output(units, X, p, a[-3], x)


@kernel
def derive(net, units, at, out, a, bounds):
    """x_p, F_p = I + diag(std) df/dX diag(1/span), G_p = diag(std) df/dxhat."""
    (X, xhat), (x, F, G) = at, out
    d, u = len(units.low), a[-1]
    for p in range(bounds[0], bounds[1]):
        inputs(units, X, xhat, p, a[0])
        value(net, a)
        output(units, X, p, a[-3], x)
        for k in range(d):
            pull_back(net, a, k, u, a[-2])
            for l in range(d):
                F[p, k, l] = units.std[k] * u[l] / units.span[l] + (1.0 if k == l else 0.0)
            for l in range(len(xhat)):
                G[p, k, l] = units.std[k] * u[d + l]


@kernel
def velocity(net, units, at, v, a, bounds):
    """v_p = dg/dxhat(X_p; xhat) vhat, at = (X, xhat, vhat)."""
    X, xhat, vhat = at
    d, u = len(units.low), a[-1]
    for p in range(bounds[0], bounds[1]):
        inputs(units, X, xhat, p, a[0])
        value(net, a)
        u[:d] = 0.0
        u[d:d + len(vhat)] = vhat
        push_forward(net, a, u, a[-2])
        for k in range(d):
            v[p, k] = units.std[k] * u[k]


@parallel
def _place_all(net, units, at, x, a):
    for c in prange(CHUNKS):
        place(net, units, at, x, a[c], chunk(c, len(at[0])))


@parallel
def _derivatives_all(net, units, at, out, a):
    for c in prange(CHUNKS):
        derive(net, units, at, out, a[c], chunk(c, len(at[0])))


@parallel
def _velocity_all(net, units, at, v, a):
    for c in prange(CHUNKS):
        velocity(net, units, at, v, a[c], chunk(c, len(at[0])))
