"""Neural laws as they are trained, with the paper's ablations (NCLAW-alg4, NCLAW-ablation).

Their networks are 13 -> 64 -> 64 -> 9 without biases (NCLAW-arch). GELU(0) = 0, so that without
biases inputs that vanish at rest give outputs that do (NCLAW-rest). Initial weights are Xavier's,
drawn as in the authors' release: after those that PyTorch draws by default, from one generator.

`PlainLawModule`      "no rotation": reads F - I, 9 numbers in 3D, and answers without R.
`UnshiftedLawModule`  "no undeformed": reads s, F^T F and det F as they are, and has biases. The
                      authors' release can leave the shift out of the elastic law alone; the text
                      has no such difference, and here neither law has it. In stored weights the
                      shift is part of the first layer's biases.
`NoFlowModule`        no return map: the flow of baselines with elasticity alone (NCLAW-eq13).
"""

from itertools import pairwise

import torch
from torch import nn

from ...materials import NoFlow
from ...materials.learned.invariants import count
from ...materials.learned.weights import LawWeights
from ...training import sha256
from .autograd import Answer, Invariants
from .rollout import LawPair

HIDDEN = (64, 64)
NO_FLOW = NoFlow()


class LawModule(nn.Module):
    """A law that is trained; its kind is one of those that `weights` can store."""

    resumed = ""        # digest of the weights that it goes on from

    def __init__(self, kind):
        super().__init__()
        self.kind = kind

    def extra_repr(self):
        """Return the kind with its constants."""
        return repr(self.kind)


def describe(law):
    """Return plain values that identify a law before training: class, constants, layer sizes, and
    the digest of the weights that it goes on from, if any.
    """
    resumed = [law.resumed] if getattr(law, "resumed", "") else []
    return [type(law).__name__, law.extra_repr(), [list(a.shape) for a in law.parameters()],
            *resumed]


class MultilayerPerceptron(nn.Module):
    """Affine maps with GELU between them; float32, (n, inputs) -> (n, outputs)."""

    activation = staticmethod(nn.functional.gelu)

    def __init__(self, inputs, outputs, hidden=HIDDEN, bias=False):
        super().__init__()
        sizes = (inputs, *hidden, outputs)
        self.layers = nn.ModuleList([nn.Linear(n, m, bias=bias) for n, m in pairwise(sizes)])
        for layer in self.layers:
            nn.init.xavier_uniform_(layer.weight)
            if bias:
                nn.init.zeros_(layer.bias)

    def forward(self, a):
        """Return the outputs (n, outputs) of inputs (n, inputs)."""
        for layer in self.layers[:-1]:
            a = self.activation(layer(a))
        return self.layers[-1](a)


def layers_of(net):
    """Return the weights [(W (in, out), b (out,))] as arrays of doubles; b is zero where there is
    no bias.
    """
    layers = []
    for layer in net.layers:
        W = layer.weight.detach().double().numpy().T.copy()
        bias = torch.zeros(len(layer.weight)) if layer.bias is None else layer.bias.detach()
        layers.append((W, bias.double().numpy().copy()))
    return layers


def put_layers(net, layers):
    """Write layers, as those of `layers_of`, into a network; biases where it has them."""
    with torch.no_grad():
        for layer, (W, b) in zip(net.layers, layers, strict=True):
            layer.weight.copy_(torch.from_numpy(W.T))
            if layer.bias is not None:
                layer.bias.copy_(torch.from_numpy(b))


class NeuralLawModule(LawModule):
    """F (n, d, d) -> answers (n, d, d) of a kind of `response` (NCLAW-alg4)."""

    def __init__(self, kind, dim=3, hidden=HIDDEN):
        super().__init__(kind)
        self.net = MultilayerPerceptron(count(dim), dim * dim, hidden)

    def forward(self, F):
        """Return the answers (n, d, d)."""
        a, R = Invariants.apply(F)
        return Answer.apply(self.net(a), F, R, self.kind)

    def weights(self):
        """Return the `LawWeights` of the law."""
        return LawWeights(tuple(layers_of(self.net)), self.kind)

    def resume(self, weights):
        """Take over the layers of `LawWeights` of the same kind and sizes."""
        put_layers(self.net, weights.layers)
        self.resumed = digest(weights)


def digest(weights):
    """Return the digest of the layers of `LawWeights`."""
    return sha256(*(a for layer in weights.layers for a in layer))


def neural_laws(seed, elastic, plastic, dim=3):
    """Return the `LawPair` before training: the elastic one is drawn first, then the plastic
    one.
    """
    torch.manual_seed(seed)
    return LawPair(NeuralLawModule(elastic, dim), NeuralLawModule(plastic, dim))


class PlainLawModule(LawModule):
    """F (n, d, d) -> answers (n, d, d) of `PlainStress` or `PlainCorrection`."""

    def __init__(self, kind, dim=3, hidden=HIDDEN):
        super().__init__(kind)
        self.net = MultilayerPerceptron(dim * dim, dim * dim, hidden)

    def forward(self, F):
        """Return the answers (n, d, d)."""
        a = (F - torch.eye(F.shape[1], dtype=F.dtype)).flatten(1).float()
        return Answer.apply(self.net(a), F, F, self.kind)

    def weights(self):
        """Return the `LawWeights` of the law."""
        return LawWeights(tuple(layers_of(self.net)), self.kind)


class UnshiftedLawModule(LawModule):
    """F (n, d, d) -> answers (n, d, d) of a kind of `response`, not zero at rest."""

    def __init__(self, kind, dim=3, hidden=HIDDEN):
        super().__init__(kind)
        self.net = MultilayerPerceptron(count(dim), dim * dim, hidden, bias=True)
        one = torch.ones(dim)
        self.rest = torch.cat([one, torch.eye(dim).flatten(), one[:1]])

    def forward(self, F):
        """Return the answers (n, d, d)."""
        a, R = Invariants.apply(F)
        return Answer.apply(self.net(a + self.rest), F, R, self.kind)

    def weights(self):
        """Return the `LawWeights` of the law, in numbers that vanish at rest."""
        (W, b), *others = layers_of(self.net)
        return LawWeights(((W, b + self.rest.double().numpy() @ W), *others), self.kind)


class NoFlowModule(LawModule):
    """The identity as a flow: F (n, d, d) stays the same, nothing is learned."""

    def __init__(self, kind=NO_FLOW):
        super().__init__(kind)

    def forward(self, F):
        """Return F (n, d, d) unchanged."""
        return F

    def weights(self):
        """Return the `LawWeights` without layers."""
        return LawWeights((), self.kind)
