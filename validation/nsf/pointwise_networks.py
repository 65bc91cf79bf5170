"""NSF's and LDM's networks point by point, compiled: the plain twin of `rom.fields.network`.

A point needs no more memory than its activations, and no library stands below. elu's slope is known
from its value: 1 for a > 0, a + 1 else. So derivatives cost one backward pass for every output
(`pull_back`), or one forward pass for every direction (`push_forward`). `infer` computes all that
NSF needs of its three networks at a point (NSF-sec5.1), in one compiled pass.

Rows are walked so that a sum over inputs adds vectors of outputs: no sum is reordered, and the
compiler may use vector registers all the same. The backward pass walks the transposed weights.
"""

from math import cos, exp, pi, sin
from typing import NamedTuple

import numpy as np

from mpm_ref.core.jit import CHUNKS, chunk, kernel, parallel, prange
from mpm_ref.rom.fields.perceptron import layers_of
from mpm_ref.rom.symmetric import tensor


def places(g, X, xhat):
    """Return x = g(X; xhat) of points X (n, d) [m]."""
    x = np.empty(X.shape)
    _place_all(transposed(g.net), g.units, (X, xhat), x, scratch(g.net))
    return x


def derivatives(g, X, xhat):
    """Return x (n, d), F (n, d, d) and dg/dxhat (n, d, r) [m] of points X (n, d)."""
    n, d = X.shape
    x, F, G = np.empty((n, d)), np.empty((n, d, d)), np.empty((n, d, g.r))
    _derivatives_all(transposed(g.net), g.units, (X, xhat), (x, F, G), scratch(g.net))
    return x, F, G


def velocities(g, X, xhat, vhat):
    """Return dg/dxhat(X; xhat) vhat of points X (n, d) [m/s]."""
    v = np.empty(X.shape)
    _velocity_all(transposed(g.net), g.units, (X, xhat, vhat), v, scratch(g.net))
    return v


class Weights(NamedTuple):
    """A `Network` with its weights twice."""

    sizes: np.ndarray
    W: np.ndarray       # of layer l an array (sizes[l], sizes[l + 1]), flattened
    WT: np.ndarray      # ... and of the transposed arrays
    b: np.ndarray


def transposed(net):
    """`Weights` of a `Network`."""
    return Weights(net.sizes, net.W, np.concatenate([W.T.ravel() for W, _ in layers_of(net)]),
                   net.b)


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
def place(net, units, given, x, a, bounds):
    """Fill x_p = g(X_p; xhat), given = (X, xhat)."""
    X, xhat = given
    for p in range(bounds[0], bounds[1]):
        inputs(units, X, xhat, p, a[0])
        value(net, a)
        output(units, X, p, a[-3], x)


@kernel
def derive(net, units, given, out, a, bounds):
    """Fill x_p, F_p = I + diag(std) df/dX diag(1/span), G_p = diag(std) df/dxhat."""
    (X, xhat), (x, F, G) = given, out
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
def velocity(net, units, given, v, a, bounds):
    """Fill v_p = dg/dxhat(X_p; xhat) vhat, given = (X, xhat, vhat)."""
    X, xhat, vhat = given
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
def _place_all(net, units, given, x, a):
    for c in prange(CHUNKS):
        place(net, units, given, x, a[c], chunk(c, len(given[0])))


@parallel
def _derivatives_all(net, units, given, out, a):
    for c in prange(CHUNKS):
        derive(net, units, given, out, a[c], chunk(c, len(given[0])))


@parallel
def _velocity_all(net, units, given, v, a):
    for c in prange(CHUNKS):
        velocity(net, units, given, v, a[c], chunk(c, len(given[0])))


class Flat(NamedTuple):
    """A network and its units in one record, since a compiled loop takes no records of records."""

    sizes: np.ndarray
    W: np.ndarray
    WT: np.ndarray
    b: np.ndarray
    low: np.ndarray
    span: np.ndarray
    mean: np.ndarray
    std: np.ndarray
    octaves: int        # of `features`; those of a position have none


def infer(g, h, l, X, xhat, mu=()):
    """Return x (n, d) [m], dg/dxhat (n, d, r) [m], tau (n, d, d) [Pa] and C (n, d, d) [1/s] at
    points X (n, d), from a `Decoder` and two `Field` of stress and affine field; mu: the
    parameters, for fields that depend on them. Raises ValueError for other numbers of coordinates.
    """
    n, d = X.shape
    out = (np.empty((n, d)), np.empty((n, d, d)), np.empty((n, d, g.r)),
           np.empty((n, h.outputs)), np.empty((n, l.outputs)))
    given = (X, np.asarray(xhat, dtype=float),
             *(f.coordinates(xhat, f.needed_parameters(mu)) for f in (h, l)))
    networks = (Flat(*transposed(f.net), *f.units[:4], getattr(f, "octaves", 0)) for f in (g, h, l))
    _infer_all(*networks, given, out, tuple(scratch(f.net) for f in (g, h, l)))
    x, _, G, tau, C = out
    return x, G, tensor(tau, d), C.reshape(n, d, d)


@kernel
def encoded(f, X, state, p, a):
    """Features of the scaled reference position, latent coordinates and parameters, into a."""
    inputs(f, X, state[:0], p, a)
    k = fill_features(a, len(f.low), f.octaves)
    a[k:k + len(state)] = state


@kernel
def fill(f, given, y, a, bounds):
    """Fill y_p = mean + std f(X_p, state), given = (X, state)."""
    X, state = given
    for p in range(bounds[0], bounds[1]):
        encoded(f, X, state, p, a[0])
        value(f, a)
        for k in range(len(f.mean)):
            y[p, k] = f.mean[k] + f.std[k] * a[-3, k]


@parallel
def _infer_all(g, h, l, given, out, a):
    for c in prange(CHUNKS):
        bounds = chunk(c, len(given[0]))
        derive(g, g, (given[0], given[1]), (out[0], out[1], out[2]), a[0][c], bounds)
        fill(h, (given[0], given[2]), out[3], a[1][c], bounds)
        fill(l, (given[0], given[3]), out[4], a[2][c], bounds)


@kernel
def elu(z):
    """z for z > 0, exp(z) - 1 else."""
    return z if z > 0.0 else exp(z) - 1.0


@kernel
def slope(a):
    """elu'(z) from a = elu(z)."""
    return 1.0 if a > 0.0 else a + 1.0


@kernel
def value(net, a):
    """Fill the rows a[1], .. with the activations of the layers from the inputs a[0]; the last row
    holds the outputs.
    """
    w, k, last = 0, 0, len(net.sizes) - 1
    for l in range(last):
        n, m = net.sizes[l], net.sizes[l + 1]
        z = a[l + 1, :m]
        z[:] = net.b[k:k + m]
        for i in range(n):
            a_i, row = a[l, i], net.W[w + i * m:w + (i + 1) * m]
            for j in range(m):
                z[j] += a_i * row[j]
        if l < last - 1:
            for j in range(m):
                z[j] = elu(z[j])
        w, k = w + n * m, k + m


@kernel
def pull_back(net, a, output, u, spare):
    """The gradient of one output with respect to the inputs, into u; a as `value` left it."""
    last = len(net.sizes) - 1
    w = len(net.W)
    u[:net.sizes[last]] = 0.0
    u[output] = 1.0
    for l in range(last - 1, -1, -1):
        n, m = net.sizes[l], net.sizes[l + 1]
        w -= n * m
        spare[:n] = 0.0
        for j in range(m):
            u_j, row = u[j], net.WT[w + j * n:w + (j + 1) * n]
            for i in range(n):
                spare[i] += u_j * row[i]
        for i in range(n):
            u[i] = spare[i] * slope(a[l, i]) if l > 0 else spare[i]


@kernel
def push_forward(net, a, u, spare):
    """The outputs' derivative in the direction u of the inputs, into u; a as `value` left it."""
    w, last = 0, len(net.sizes) - 1
    for l in range(last):
        n, m = net.sizes[l], net.sizes[l + 1]
        spare[:m] = 0.0
        for i in range(n):
            u_i, row = u[i], net.W[w + i * m:w + (i + 1) * m]
            for j in range(m):
                spare[j] += u_i * row[j]
        for j in range(m):
            u[j] = spare[j] * slope(a[l + 1, j]) if l < last - 1 else spare[j]
        w += n * m


@kernel
def fill_features(a, d, octaves):
    """Append the features of the place whose d numbers stand at the start of a; returns how many
    numbers there are then.
    """
    k = d
    for o in range(octaves):
        for i in range(d):
            a[k + i] = sin(2.0**o * pi * a[i])
            a[k + d + i] = cos(2.0**o * pi * a[i])
        k += 2 * d
    return k
