"""Adjoint of trained networks as materials: the bar of F from that of a stress or of a new F.

Backwards through `network.respond`: the answer, the layers

    z_l = a_l W_l + b_l,   z_bar_l = a_bar_{l+1} gelu'(z_l),   a_bar_l = W_l z_bar_l

and the invariants. Weights get no bar: `mpm_ref.nclaw.train` learns them with PyTorch. A law whose
strains are cut (`guard`) has no adjoint.
"""

from math import erf, exp, pi, sqrt

import numpy as np

from ...core import law as names
from ...core.jit import kernel
from ...core.spectral import svd
from ...core.tensor import mat, mlin, mmt
from .invariants import pulled
from .layers import ROOT, gelu, outputs
from .network import FLOW_CLASSES, INPUTS, LAW_CLASSES, read_inputs, square
from .response import bars

DENSITY = 1.0 / sqrt(2.0 * pi)      # of the normal distribution at 0


@kernel
def gelu_slope(z):
    """Return the derivative of `gelu`."""
    return 0.5 * (1.0 + erf(ROOT * z)) + z * DENSITY * exp(-0.5 * z * z)


@kernel
def affine(a, W, b):
    """Return a W + b."""
    z = b.copy()
    for i in range(len(a)):
        for j in range(len(b)):
            z[j] += a[i] * W[i * len(b) + j]
    return z


@kernel
def before_activation(a, sizes, W, b):
    """Return the z of all hidden layers, one after the other."""
    z = np.empty(sizes[1:-1].sum())
    w = k = 0
    for l in range(len(sizes) - 2):
        n, m = sizes[l], sizes[l + 1]
        z[k:k + m] = affine(a, W[w:w + n * m], b[k:k + m])
        a = np.empty(m)
        for j in range(m):
            a[j] = gelu(z[k + j])
        w, k = w + n * m, k + m
    return z


@kernel
def input_bar(a, y_bar, sizes, W, b):
    """Return the bar of a network's inputs a from that of its outputs."""
    z = before_activation(a, sizes, W, b)
    w, k, bar = len(W), len(z), y_bar
    for l in range(len(sizes) - 2, -1, -1):
        n, m = sizes[l], sizes[l + 1]
        w -= n * m
        a_bar = np.zeros(n)
        for i in range(n):
            for j in range(m):
                a_bar[i] += W[w + i * m + j] * bar[j]
        if l > 0:
            k -= n
            for i in range(n):
                a_bar[i] *= gelu_slope(z[k + i])
        bar = a_bar
    return bar


@kernel
def respond_bar(F, G, law):
    """Return the bar of F from that of the answer, G, of a law or a flow."""
    U, s, V, _ = svd(F)
    d = len(F)
    a = np.empty(INPUTS)
    read_inputs(F, s, law.sizes, a)
    inputs = a[:law.sizes[0]].copy()
    outputs(a, law.sizes, law.W, law.b)
    Y = square(a, F)
    Y_bar, F_bar, R_bar = bars(G, Y, F, mmt(U, V), law)
    y_bar = np.empty(d * d)
    for i in range(d):
        for j in range(d):
            y_bar[d * i + j] = Y_bar[i][j]
    a_bar = input_bar(inputs, y_bar, law.sizes, law.W, law.b)
    if law.sizes[0] == d * d:
        from_inputs = mat(a_bar.reshape(1, d, d), 0, F)
    else:
        from_inputs = pulled(F, (U, s, V), a_bar, R_bar)
    return mlin(1.0, F_bar, 1.0, from_inputs)


for _kind, _class in (*LAW_CLASSES.items(), *FLOW_CLASSES.items()):
    bars.method(_class, bars.methods[_kind])
for _class in LAW_CLASSES.values():
    names.kirchhoff_bar.method(_class, respond_bar)
for _class in FLOW_CLASSES.values():
    names.returned_bar.method(_class, respond_bar)
