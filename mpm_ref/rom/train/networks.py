"""Networks in PyTorch: perceptrons of fields, and sources of latent coordinates.

`FieldPerceptron` has the numbers of `fields.perceptron`, with gradients for its weights.

Latent coordinates come from an encoder, are one unknown vector for each snapshot, or are given. The
encoder is a stack of one-dimensional convolutions and two full layers (LDM-tab1, NSF-encoder; see
`architecture`). It ties the latent coordinates to one sampling of the body; reduced runs do not
need it.
"""

from itertools import pairwise
from math import pi

import numpy as np
import torch
from torch import nn

from ..fields.architecture import FEATURES, HIDDEN, KERNEL
from ..fields.network import Decoder, DecoderUnits
from ..fields.perceptron import feature_count, layers_of, network


class FieldPerceptron(nn.Module):
    """The perceptron f of `rom.fields.network`, from scaled (X, xhat) to standardised
    displacements, or to `outputs` other values; for fields that depend on parameters, xhat includes
    them.
    """

    def __init__(self, dim, r, hidden=HIDDEN, outputs=None, octaves=0):
        super().__init__()
        self.octaves = octaves
        self.layers = nn.ModuleList(nn.Linear(n, m) for n, m in pairwise(
            (feature_count(dim, octaves) + r, *hidden, outputs or dim)))
        for layer in self.layers:
            nn.init.xavier_uniform_(layer.weight)           # LDM-appB

    def forward(self, X, xhat):
        """Return outputs (n, k) of scaled positions X (n, d) and latent coordinates xhat (n, r)."""
        a = torch.cat([self.features(X), xhat], dim=-1)
        for layer in self.layers[:-1]:
            a = nn.functional.elu(layer(a))
        return self.layers[-1](a)

    def features(self, X):
        """Return the Fourier features of places, as `rom.fields.perceptron` does."""
        waves = [wave(2.0**o * pi * X) for o in range(self.octaves)
                 for wave in (torch.sin, torch.cos)]
        return torch.cat([X, *waves], dim=-1)


def with_derivatives(f, X, xhat):
    """Return y (n, d), dy/dX (n, d, d) and dy/dxhat (n, d, r), through which gradients flow."""
    X, xhat = X.requires_grad_(), xhat if xhat.requires_grad else xhat.requires_grad_()
    y = f(X, xhat)
    pulled = [torch.autograd.grad(y[:, k].sum(), (X, xhat), create_graph=True)
              for k in range(y.shape[1])]
    return y, *(torch.stack(parts, dim=1) for parts in zip(*pulled, strict=True))


def network_of(f):
    """Return the `Network` of a trained perceptron."""
    return network([(layer.weight.detach().cpu().double().numpy().T,
                     layer.bias.detach().cpu().double().numpy()) for layer in f.layers])


def decoder_of(f, units):
    """Return the `Decoder` of a trained perceptron."""
    return Decoder(network_of(f), DecoderUnits(*(np.asarray(a, dtype=float) for a in units)))


def perceptron_of(field):
    """Return the `FieldPerceptron` of a `Decoder` or a `Field`, in double precision."""
    first, *hidden, last = field.net.sizes.tolist()
    octaves = getattr(field, "octaves", 0)
    d = field.dim
    f = FieldPerceptron(d, first - feature_count(d, octaves), hidden, last, octaves).double()
    with torch.no_grad():
        for layer, (W, b) in zip(f.layers, layers_of(field.net), strict=True):
            layer.weight.copy_(torch.from_numpy(W.T.copy()))
            layer.bias.copy_(torch.from_numpy(b.copy()))
    return f


class Encoder(nn.Module):
    """Encoder xhat = e(standardised displacements of all points) (LDM-sec4.1-encoder, NSF-encoder),
    in one row of values or one for each axis, as its `Stack` has it.

    There is no activation after the last layer; the public training code of NSF's precursor has an
    ELU there, and fewer convolutions.
    """

    def __init__(self, stack, r):
        super().__init__()
        self.rows = stack.rows[0]
        self.convolutions = nn.ModuleList(nn.Conv1d(n, m, KERNEL, stack.stride)
                                          for n, m in pairwise(stack.rows))
        self.full = nn.Linear(stack.rows[-1] * stack.lengths[-1], FEATURES)
        self.last = nn.Linear(FEATURES, r)
        for layer in (*self.convolutions, self.full, self.last):
            nn.init.xavier_uniform_(layer.weight)

    def forward(self, u):
        """Return the latent coordinates (s, r) of displacements u (s, n, d)."""
        a = u.reshape(len(u), -1, self.rows).transpose(1, 2)
        for layer in self.convolutions:
            a = nn.functional.elu(layer(a))
        return self.last(nn.functional.elu(self.full(a.flatten(1))))


class LatentTable(nn.Module):
    """Latent coordinates as unknowns of the training, one vector for each snapshot (LDMW-eq7)."""

    def __init__(self, snapshots, r):
        super().__init__()
        self.table = nn.Embedding(snapshots, r)
        nn.init.normal_(self.table.weight, std=0.1)

    def forward(self, index):
        """Return the latent coordinates (s, r) of snapshots by number."""
        return self.table(index)


class FixedLatents(nn.Module):
    """Latent coordinates that are given before the training, one vector for each snapshot; and the
    modes (n, d, r) [m] of which they are coefficients, if any.
    """

    def __init__(self, xhat, modes=None):
        super().__init__()
        self.register_buffer("table", torch.as_tensor(xhat, dtype=torch.float32))
        self.register_buffer("modes", None if modes is None else torch.as_tensor(
            modes, dtype=torch.float32), persistent=False)

    def forward(self, index):
        """Return the latent coordinates (s, r) of snapshots by number."""
        return self.table[index]


def encode(encoder, u, batch=64):
    """Return the latent coordinates of many snapshots u (s, n, d), without gradients."""
    with torch.no_grad():
        return torch.cat([encoder(u[i:i + batch]) for i in range(0, len(u), batch)])
