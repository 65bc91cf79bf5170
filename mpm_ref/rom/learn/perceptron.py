"""The decoder in torch: the same numbers as `rom.decoder`, with gradients for its weights."""

from itertools import pairwise

import numpy as np
import torch
from torch import nn

from ..architecture import HIDDEN
from ..decoder import Decoder, Units
from ..network import layers_of, network


class Perceptron(nn.Module):
    """f of `rom.decoder`: scaled (X, xhat) to standardised displacements."""

    def __init__(self, dim, r, hidden=HIDDEN):
        super().__init__()
        self.dim, self.r = dim, r
        self.layers = nn.ModuleList(nn.Linear(n, m) for n, m in pairwise((dim + r, *hidden, dim)))
        for layer in self.layers:
            nn.init.xavier_uniform_(layer.weight)           # LDM-appB

    def forward(self, X, xhat):
        """Outputs (n, d) of scaled positions X (n, d) and latent coordinates xhat (n, r)."""
        a = torch.cat([X, xhat], dim=-1)
        for layer in self.layers[:-1]:
            a = nn.functional.elu(layer(a))
        return self.layers[-1](a)


def with_derivatives(f, X, xhat):
    """y (n, d), dy/dX (n, d, d) and dy/dxhat (n, d, r), through which gradients flow."""
    X, xhat = X.requires_grad_(), xhat if xhat.requires_grad else xhat.requires_grad_()
    y = f(X, xhat)
    pulled = [torch.autograd.grad(y[:, k].sum(), (X, xhat), create_graph=True)
              for k in range(y.shape[1])]
    return y, *(torch.stack(parts, dim=1) for parts in zip(*pulled, strict=True))


def exported(f, units):
    """The `Decoder` of a trained perceptron."""
    layers = [(layer.weight.detach().double().numpy().T, layer.bias.detach().double().numpy())
              for layer in f.layers]
    return Decoder(network(layers), Units(*(np.asarray(a, dtype=float) for a in units)))


def imported(decoder):
    """The `Perceptron` of a `Decoder`, in double precision."""
    sizes = decoder.net.sizes
    f = Perceptron(decoder.dim, decoder.r, [int(n) for n in sizes[1:-1]]).double()
    with torch.no_grad():
        for layer, (W, b) in zip(f.layers, layers_of(decoder.net), strict=True):
            layer.weight.copy_(torch.from_numpy(W.T.copy()))
            layer.bias.copy_(torch.from_numpy(b.copy()))
    return f
