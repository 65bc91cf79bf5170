"""Trained laws in principal stretches as laws of `core.law`, for runs without PyTorch.

    tau = U diag(y s) U^T,    F = U diag(s) V^T,    y of `spline` or of a network (see `principal`)

`kirchhoff` is all that they have: they go with no return map, and are not for implicit steps.
"""

from itertools import permutations
from math import expm1
from typing import NamedTuple

import numpy as np

from ...core import law
from ...core.jit import by_type, kernel
from ...core.spectral import svd
from .principal import ReleasedStretchStress, StretchStress, stress_of
from .spline import READINGS, knots


class Splines(NamedTuple):
    """f, g, h as pieces (see `spline.Pieces`); 3D."""

    breaks: np.ndarray      # (p - 1,)
    origins: np.ndarray     # (p,)
    tables: np.ndarray      # (3, p, 4) coefficients of powers 3 .. 0 [Pa]


class Network(NamedTuple):
    """Three layers with ELU between them, read in some orders of s; 3D."""

    orders: np.ndarray      # (k, 3)
    W0: np.ndarray          # (3, hidden)
    b0: np.ndarray          # (hidden,)
    W1: np.ndarray          # (hidden, hidden)
    b1: np.ndarray
    W2: np.ndarray          # (hidden, 3) [Pa]
    b2: np.ndarray          # (3,) [Pa]


def elastic(trained):
    """The law of a `weights.Trained` in 3D, of a kind of `spline` or `principal`.

    Raises ValueError for other kinds, and for networks that have not three layers.
    """
    kind, layers = trained.kind, trained.layers
    if type(kind) in READINGS:
        pieces = READINGS[type(kind)](knots())
        tables = np.einsum("pmk,kf->fpm", pieces.basis, kind.unit * layers[0][0])
        return Splines(pieces.breaks.copy(), pieces.origins.copy(), np.ascontiguousarray(tables))
    if not isinstance(kind, ReleasedStretchStress | StretchStress):
        raise ValueError(f"a law of kind {type(kind).__name__}: expected splines or a network in "
                         "principal stretches")
    if len(layers) != 3 or len(layers[0][0]) != 3:
        raise ValueError(f"layers of sizes {[W.shape for W, _ in layers]}: expected three, from 3 "
                         "numbers to 3")
    orders = [(0, 1, 2)] if isinstance(kind, ReleasedStretchStress) else [*permutations(range(3))]
    *inner, (W, b) = layers
    rows = [np.ascontiguousarray(a) for layer in (*inner, (kind.unit * W, kind.unit * b))
            for a in layer]
    return Network(np.array(orders), *rows)


principal = by_type("principal")        # (s, law) -> y [Pa]


@kernel
def kirchhoff(F, law):
    """tau [Pa]."""
    U, s, _, _ = svd(F)
    return stress_of(U, s, principal(s, law))


@kernel
def splined(s, law):
    """y_i = f(s_i) + sum_j g(s_i s_j) s_j + h(J) J/s_i."""
    g01, g02, g12 = (at(law, 1, s[0] * s[1]), at(law, 1, s[0] * s[2]), at(law, 1, s[1] * s[2]))
    h = at(law, 2, s[0] * s[1] * s[2])
    return (at(law, 0, s[0]) + g01 * s[1] + g02 * s[2] + h * s[1] * s[2],
            at(law, 0, s[1]) + g01 * s[0] + g12 * s[2] + h * s[0] * s[2],
            at(law, 0, s[2]) + g02 * s[0] + g12 * s[1] + h * s[0] * s[1])


@kernel
def at(law, k, x):
    """f, g or h, of k = 0, 1, 2, at x."""
    p = np.searchsorted(law.breaks, x)
    c, t = law.tables[k, p], x - law.origins[p]
    return ((c[0] * t + c[1]) * t + c[2]) * t + c[3]


@kernel
def averaged(s, law):
    """The mean of what the network gives, over the orders in which it reads s."""
    y = np.zeros(3)
    for k in range(len(law.orders)):
        i = law.orders[k]
        read = np.array((s[i[0]] - 1.0, s[i[1]] - 1.0, s[i[2]] - 1.0))
        given = affine(elu(affine(elu(affine(read, law.W0, law.b0)), law.W1, law.b1)),
                       law.W2, law.b2)
        for m in range(3):
            y[i[m]] += given[m]
    return y[0] / len(law.orders), y[1] / len(law.orders), y[2] / len(law.orders)


@kernel
def affine(a, W, b):
    """a W + b."""
    out = b.copy()
    for i in range(len(a)):
        for j in range(len(b)):
            out[j] += a[i] * W[i, j]
    return out


@kernel
def elu(a):
    """a, or exp(a) - 1 where it is negative; in place."""
    for i in range(len(a)):
        a[i] = a[i] if a[i] > 0.0 else expm1(a[i])
    return a


for _law, _principal in ((Splines, splined), (Network, averaged)):
    principal.method(_law, _principal)
    law.kirchhoff.method(_law, kirchhoff)
