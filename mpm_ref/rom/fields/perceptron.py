"""A multilayer perceptron y = f(a) and its derivatives, for many points at once.

    a_0 = a,   z_l = a_l W_l + b_l,   a_{l+1} = elu(z_l),   y = a_{L-1} W_{L-1} + b_{L-1}   LDM-tab1

elu(z) = z for z > 0, exp(z) - 1 else: once continuously differentiable, as F and v need
(LDM-sec4-act). With the slopes D_l = elu'(z_l) = exp(min(z_l, 0)),

    dy_k/da_l = (dy_k/da_{l+1} * D_l) W_l^T        one pass back for every output
    dy        = (.. (u W_0 * D_0) W_1 * D_1 ..)    one pass forward for a direction u

The products are those of BLAS and the exponentials those of NumPy. Points are taken ROWS at a time,
so that a batch stays in the cache, and threads share the batches, each with BLAS of its own: the
numbers do not depend on the threads. A point's numbers do depend, to round-off, on how many points
share its batch.

A network may read Fourier features of a place [Tancik2020]: fields of them are sharper than those
of places alone. They are, of places Z scaled to the unit box, d numbers each,

    Z -> (Z, sin(pi Z), cos(pi Z), sin(2 pi Z), cos(2 pi Z), sin(4 pi Z), cos(4 pi Z), ..),

a sine and a cosine for each octave; without octaves, Z as it is. NSF has no such features.
"""

from concurrent.futures import ThreadPoolExecutor
from math import pi
from typing import NamedTuple

import numba
import numpy as np

from ...core.blas import one_thread

ROWS = 1024
MIN_BATCHES = 2     # of a thread, so that it is worth its start


class Network(NamedTuple):
    """Weights of a perceptron, layer after layer."""

    sizes: np.ndarray   # widths of the layers, inputs first, outputs last; integer
    W: np.ndarray       # weights: of layer l an array (sizes[l], sizes[l + 1]), flattened
    b: np.ndarray       # biases: of layer l an array (sizes[l + 1],)


def network(layers):
    """Return the `Network` of layers [(W (in, out), b (out,))]. Raises ValueError where they do not
    fit.
    """
    if not layers:
        raise ValueError("layers = []: expected at least one (W, b)")
    sizes = [len(layers[0][0])]
    for k, (W, b) in enumerate(layers):
        if W.ndim != 2 or b.shape != W.shape[1:] or len(W) != sizes[-1]:
            raise ValueError(f"layer {k}: weights {W.shape} and biases {b.shape} after {sizes[-1]} "
                             "values: expected (in, out) and (out,)")
        if not (np.isfinite(W).all() and np.isfinite(b).all()):
            raise ValueError(f"layer {k}: a weight or bias is not finite")
        sizes.append(W.shape[1])
    flat = [np.concatenate([np.ravel(a) for a in arrays]).astype(float)
            for arrays in zip(*layers, strict=True)]
    return Network(np.array(sizes), *flat)


def layers_of(net):
    """Return the layers [(W (in, out), b (out,))] of a `Network`."""
    layers, w, k = [], 0, 0
    for n, m in zip(net.sizes[:-1], net.sizes[1:], strict=True):
        layers.append((net.W[w:w + n * m].reshape(n, m), net.b[k:k + m]))
        w, k = w + n * m, k + m
    return layers


def batches(n):
    """Return slices of n points, ROWS long but the last."""
    return [slice(start, min(start + ROWS, n)) for start in range(0, n, ROWS)]


def for_batches(n, work):
    """Call work(rows) for all batches of n points, on as many threads as kernels run on."""
    parts = batches(n)
    threads = min(len(parts) // MIN_BATCHES, numba.get_num_threads())
    with one_thread():
        if threads < 2:
            for rows in parts:
                work(rows)
            return
        with ThreadPoolExecutor(threads) as pool:
            list(pool.map(work, parts))


def forward(layers, A):
    """Return the outputs (n, d) of inputs A (n, in), and the slopes D_l (n, width) of all hidden
    layers.
    """
    slopes = []
    for W, b in layers[:-1]:
        Z = A @ W
        Z += b
        D = np.minimum(Z, 0.0)
        np.exp(D, out=D)
        np.maximum(Z, 0.0, out=Z)
        Z += D
        Z -= 1.0                        # elu(z) = max(z, 0) + exp(min(z, 0)) - 1
        slopes.append(D)
        A = Z
    W, b = layers[-1]
    return A @ W + b, slopes


def backward(layers, slopes, k):
    """Return the gradients (n, in) of output k with respect to the inputs."""
    U = layers[-1][0][:, k]
    for (W, _), D in zip(layers[-2::-1], slopes[::-1], strict=True):
        U = (U * D) @ W.T
    return U


def directional(layers, slopes, u):
    """Return the derivative (n, d) of the outputs in a direction u (in,) of the inputs."""
    U = u
    for (W, _), D in zip(layers[:-1], slopes, strict=True):
        U = (U @ W) * D
    return U @ layers[-1][0]


def feature_count(d, octaves):
    """Return the number of features of a place with d numbers."""
    return d * (1 + 2 * octaves)


def features(Z, octaves):
    """Return the Fourier features (n, d (1 + 2 octaves)) of scaled places Z (n, d)."""
    if octaves == 0:
        return Z
    waves = [wave(2.0**o * pi * Z) for o in range(octaves) for wave in (np.sin, np.cos)]
    return np.concatenate([Z, *waves], axis=1)
