"""All that NSF asks of its three networks at a point (NSF-sec5.1), in one compiled pass.

The plain twin of `learned`, as `pointwise` is that of `decoder`: point by point, no more memory
than a point needs, and no library below it.
"""

from typing import NamedTuple

import numpy as np

from ..core.jit import CHUNKS, chunk, kernel, parallel, prange
from .features import fill as fill_features
from .network import value
from .pointwise import derive, inputs, scratch
from .symmetric import tensor


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
    """x (n, d) [m], dg/dxhat (n, d, r) [m], tau (n, d, d) [Pa] and C (n, d, d) [1/s] at points X
    (n, d), from a `Decoder` and two `Field` of stress and affine field; mu: the parameters, for
    fields that depend on them. Raises ValueError for other numbers of coordinates.
    """
    n, d = X.shape
    out = (np.empty((n, d)), np.empty((n, d, d)), np.empty((n, d, g.r)),
           np.empty((n, h.outputs)), np.empty((n, l.outputs)))
    at = (X, np.asarray(xhat, dtype=float), *(f.coordinates(xhat, f.own(mu)) for f in (h, l)))
    networks = (Flat(*f.net, *f.units[:4], getattr(f, "octaves", 0)) for f in (g, h, l))
    _infer_all(*networks, at, out, tuple(scratch(f.net) for f in (g, h, l)))
    x, _, G, tau, C = out
    return x, G, tensor(tau, d), C.reshape(n, d, d)


@kernel
def encoded(f, X, state, p, a):
    """Features of the scaled reference position, latent coordinates and parameters, into a."""
    inputs(f, X, state[:0], p, a)
    k = fill_features(a, len(f.low), f.octaves)
    a[k:k + len(state)] = state


@kernel
def fill(f, at, y, a, bounds):
    """y_p = mean + std f(X_p, state), at = (X, state)."""
    X, state = at
    for p in range(bounds[0], bounds[1]):
        encoded(f, X, state, p, a[0])
        value(f, a)
        for k in range(len(f.mean)):
            y[p, k] = f.mean[k] + f.std[k] * a[-3, k]


@parallel
def _infer_all(g, h, l, at, out, a):
    for c in prange(CHUNKS):
        bounds = chunk(c, len(at[0]))
        derive(g, g, (at[0], at[1]), (out[0], out[1], out[2]), a[0][c], bounds)
        fill(h, (at[0], at[2]), out[3], a[1][c], bounds)
        fill(l, (at[0], at[3]), out[4], a[2][c], bounds)
