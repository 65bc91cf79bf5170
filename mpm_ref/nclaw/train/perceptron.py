"""The networks of neural laws: 13 -> 64 -> 64 -> 9 without biases (NCLAW-arch).

GELU(0) = 0, so that without biases what vanishes at rest gives an answer that does
(NCLAW-rest). Weights begin as Xavier's, drawn as the authors' release draws them: after those that
PyTorch draws by itself, from the same generator.
"""

from itertools import pairwise

import torch
from torch import nn

HIDDEN = (64, 64)


class Perceptron(nn.Module):
    """Affine maps with GELU between them; float32, (n, inputs) -> (n, outputs)."""

    def __init__(self, inputs, outputs, hidden=HIDDEN, bias=False):
        super().__init__()
        sizes = (inputs, *hidden, outputs)
        self.layers = nn.ModuleList([nn.Linear(n, m, bias=bias) for n, m in pairwise(sizes)])
        for layer in self.layers:
            nn.init.xavier_uniform_(layer.weight)
            if bias:
                nn.init.zeros_(layer.bias)

    def forward(self, a):
        """Outputs (n, outputs) of inputs (n, inputs)."""
        for layer in self.layers[:-1]:
            a = nn.functional.gelu(layer(a))
        return self.layers[-1](a)


def layers_of(net):
    """Weights [(W (in, out), b (out,))] as arrays of doubles; b is zero where there is no bias."""
    found = []
    for layer in net.layers:
        W = layer.weight.detach().double().numpy().T.copy()
        bias = torch.zeros(len(layer.weight)) if layer.bias is None else layer.bias.detach()
        found.append((W, bias.double().numpy().copy()))
    return found
