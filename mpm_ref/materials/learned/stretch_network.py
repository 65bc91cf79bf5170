"""Networks in principal stretches, the paper's baseline "neural" (NCLAW-methods), as elastic laws.

    tau = U diag(y s) U^T,    F = U diag(s) V^T,    y = unit network(s - 1)

The network has three layers with ELU between them. `kirchhoff` is all that the law has: it goes
with no return map, and not with implicit steps. `principal` has the formula of the stress.
"""

from itertools import permutations
from math import expm1
from typing import NamedTuple

import numpy as np

from ...core import law as registry
from ...core.jit import kernel
from .principal import kirchhoff, stretch_response


class StretchStress(NamedTuple):
    """Kirchhoff stress of a network d -> d of s - 1 with ELU between layers, made isotropic: y is
    the mean over all orders in which s can be read.
    """

    unit: float = 1.0       # of y [Pa]


class ReleasedStretchStress(NamedTuple):
    """Kirchhoff stress of a network of the descending s alone, as the authors' release reads it."""

    unit: float = 1.0       # of y [Pa]


class StretchNetworkLaw(NamedTuple):
    """Three layers with ELU between them, read in some orders of s; 3D."""

    orders: np.ndarray      # (k, 3)
    W0: np.ndarray          # (3, hidden)
    b0: np.ndarray          # (hidden,)
    W1: np.ndarray          # (hidden, hidden)
    b1: np.ndarray
    W2: np.ndarray          # (hidden, 3) [Pa]
    b2: np.ndarray          # (3,) [Pa]


def build_law(weights):
    """Return the `StretchNetworkLaw` of `LawWeights`. Raises ValueError unless there are three
    layers.
    """
    kind, layers = weights.kind, weights.layers
    if len(layers) != 3 or len(layers[0][0]) != 3:
        raise ValueError(f"layers of sizes {[W.shape for W, _ in layers]}: expected three, from 3 "
                         "numbers to 3")
    orders = [(0, 1, 2)] if isinstance(kind, ReleasedStretchStress) else [*permutations(range(3))]
    *inner, (W, b) = layers
    rows = [np.ascontiguousarray(a) for layer in (*inner, (kind.unit * W, kind.unit * b))
            for a in layer]
    return StretchNetworkLaw(np.array(orders), *rows)


@kernel
def averaged(s, law):
    """Return the mean of what the network gives, over the orders in which it reads s."""
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
    """Return a W + b."""
    out = b.copy()
    for i in range(len(a)):
        for j in range(len(b)):
            out[j] += a[i] * W[i, j]
    return out


@kernel
def elu(a):
    """Return a, or exp(a) - 1 where it is negative; in place."""
    for i in range(len(a)):
        a[i] = a[i] if a[i] > 0.0 else expm1(a[i])
    return a


stretch_response.method(StretchNetworkLaw, averaged)
registry.kirchhoff.method(StretchNetworkLaw, kirchhoff)
