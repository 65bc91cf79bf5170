"""Networks in torch: the numbers of `fields.perceptron`, with gradients for their weights."""

from itertools import pairwise
from math import pi

import numpy as np
import torch
from torch import nn

from ..fields.architecture import HIDDEN
from ..fields.network import Decoder, DecoderUnits
from ..fields.perceptron import feature_count, layers_of, network


class FieldPerceptron(nn.Module):
    """f of `rom.fields.network`: scaled (X, xhat) to standardised displacements, or to `outputs`
    other values; for fields that depend on parameters, xhat stands for both.
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
