"""The graph network [GNS] as it is trained; single precision. See `gnn.network`.

Weights are drawn from a normal distribution of variance 1/inputs, cut at two deviations; biases
begin at zero. The first layer of an edge's perceptron is applied to the points first and then
gathered to the edges: an equal sum with fewer products.
"""

from itertools import pairwise

import torch
from torch import nn

from .. import network
from ..features import HISTORY
from ..weights import LAYERS


class NormedPerceptron(nn.Module):
    """Affine maps with max(z, 0) between them, then a normalisation unless `norm` is False."""

    def __init__(self, inputs, width, outputs, norm=True):
        super().__init__()
        sizes = (inputs, *(LAYERS - 1) * (width,), outputs)
        self.layers = nn.ModuleList([nn.Linear(n, m) for n, m in pairwise(sizes)])
        for layer in self.layers:
            deviation = layer.in_features**-0.5
            nn.init.trunc_normal_(layer.weight, std=deviation, a=-2 * deviation, b=2 * deviation)
            nn.init.zeros_(layer.bias)
        self.norm = nn.LayerNorm(outputs, eps=network.TINY) if norm else nn.Identity()

    def forward(self, a):
        """Return the outputs (n, outputs) of inputs (n, inputs)."""
        return self.onward(self.layers[0](a))

    def onward(self, z):
        """Return the outputs of what the first layer gives (n, width)."""
        for layer in self.layers[1:]:
            z = layer(torch.relu(z))
        return self.norm(z)


class Block(nn.Module):
    """One round of message passing."""

    def __init__(self, width):
        super().__init__()
        self.edges = NormedPerceptron(3 * width, width, width)
        self.points = NormedPerceptron(2 * width, width, width)

    def forward(self, v, e, senders, receivers):
        """Return v (n, width) and e (k, width) after it."""
        first = self.edges.layers[0]
        of_edge, sent, received = first.weight.split(v.shape[1], dim=1)
        z = nn.functional.linear(e, of_edge, first.bias)
        for weight, ends in ((sent, senders), (received, receivers)):
            z = z + nn.functional.linear(v, weight).index_select(0, ends)
        m = self.edges.onward(z)
        gathered = torch.zeros_like(v).index_add(0, receivers, m)
        return v + self.points(torch.cat([v, gathered], dim=1)), e + m


class GraphNetwork(nn.Module):
    """A graph network: features of points (n, ..) and edges (k, ..) -> answers (n, d)."""

    def __init__(self, dim=3, width=128, blocks=10):
        super().__init__()
        self.points = NormedPerceptron((HISTORY + 2) * dim, width, width)
        self.edges = NormedPerceptron(dim + 1, width, width)
        self.blocks = nn.ModuleList([Block(width) for _ in range(blocks)])
        self.answer = NormedPerceptron(width, width, dim, norm=False)

    def forward(self, points, edges, graph):
        """Return the answers; graph: `Graph` of tensors."""
        v, e = self.points(points), self.edges(edges)
        for block in self.blocks:
            v, e = block(v, e, *graph)
        return self.answer(v)


def export_weights(net):
    """Return the `gnn.network.GraphWeights` of a `GraphNetwork`, in doubles."""
    blocks = tuple((export_perceptron(block.edges), export_perceptron(block.points))
                   for block in net.blocks)
    return network.GraphWeights(export_perceptron(net.points), export_perceptron(net.edges),
                                blocks, export_perceptron(net.answer))


def export_perceptron(perceptron):
    """Return the `gnn.network.PerceptronWeights` of a `NormedPerceptron`."""
    layers = tuple((double(layer.weight).T.copy(), double(layer.bias))
                   for layer in perceptron.layers)
    return network.PerceptronWeights(layers, tuple(map(double, perceptron.norm.parameters())))


def double(parameter):
    """Return a parameter as an array of doubles, a copy."""
    return parameter.detach().double().numpy().copy()
