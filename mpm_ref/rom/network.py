"""A multilayer perceptron y = f(a), its values and its derivatives, point by point.

    a_0 = a,   a_{l+1} = elu(a_l W_l + b_l),   y = a_{L-1} W_{L-1} + b_{L-1}            LDM-tab1

elu(z) = z for z > 0, exp(z) - 1 else: once continuously differentiable, as F and v need
(LDM-sec4-act). Its slope is known from its value: 1 for a > 0, a + 1 else. So derivatives cost one
backward pass for every output (`pull_back`), or one forward pass for every direction
(`push_forward`).

Rows are walked so that a sum over inputs adds vectors of outputs: no sum is reordered, and the
compiler may use vector registers all the same. The backward pass walks the transposed weights.
"""

from math import exp
from typing import NamedTuple

import numpy as np

from ..core.jit import kernel


class Network(NamedTuple):
    """Weights of a perceptron, layer after layer."""

    sizes: np.ndarray   # widths of the layers, inputs first, outputs last; integer
    W: np.ndarray       # weights: of layer l an array (sizes[l], sizes[l + 1]), flattened
    WT: np.ndarray      # the same of the transposed arrays
    b: np.ndarray       # biases: of layer l an array (sizes[l + 1],)


def network(layers):
    """`Network` of layers [(W (in, out), b (out,))]. Raises ValueError where they do not fit."""
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
    flat = [np.concatenate([np.ravel(a, order=order) for a in arrays]).astype(float)
            for arrays, order in (([W for W, _ in layers], "C"), ([W for W, _ in layers], "F"),
                                  ([b for _, b in layers], "C"))]
    return Network(np.array(sizes), *flat)


def layers_of(net):
    """The layers [(W (in, out), b (out,))] of a `Network`."""
    found, w, k = [], 0, 0
    for n, m in zip(net.sizes[:-1], net.sizes[1:], strict=True):
        found.append((net.W[w:w + n * m].reshape(n, m), net.b[k:k + m]))
        w, k = w + n * m, k + m
    return found


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
