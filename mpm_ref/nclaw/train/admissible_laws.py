"""Laws that thermodynamics admits, as they are trained (`energetic`, `contraction`); in doubles.

The logarithms of the energy's weights are learned, so that weights stay positive; biases are
unconstrained. Training starts from moduli of about `kind.unit`, and from a return that removes a
share START of the strain in a step, as much as NCLAW-alg4 adds. It starts with little of r, which
grows with the fourth power of stretches: otherwise the first epochs remove all stress with it.
"""

from itertools import pairwise
from math import log

import torch
from torch import nn
from torch.autograd import Function

from ...materials.learned import contraction, energetic
from ...materials.learned.invariants import spectrum
from ...materials.learned.weights import LawWeights
from .neural_laws import LawModule, MultilayerPerceptron, digest, layers_of, put_layers

HIDDEN = {"elastic": (16, 16), "plastic": (32, 32)}
START = 1e-3        # a and b of the return map, at first
SHARES = 1.0, 0.02, 1.0, 1.0        # of q, r, u, w in the energy, at first


class Measures(Function):
    """F (n, 3, 3) -> q, r, u, w (n, 4)."""

    @staticmethod
    def forward(ctx, F):
        """Return the measures (n, 4)."""
        ctx.F = F.contiguous().numpy()
        return torch.from_numpy(energetic.measures_of(ctx.F))

    @staticmethod
    def backward(ctx, m_bar):
        """Return the gradient of F."""
        return torch.from_numpy(energetic.pull_back_measures(m_bar.contiguous().numpy(), ctx.F))


class EnergyStress(Function):
    """Slopes g (n, 4) of an energy and F (n, 3, 3) -> tau (n, 3, 3)."""

    @staticmethod
    def forward(ctx, g, F):
        """Return tau (n, 3, 3) in units of the energy."""
        ctx.inputs = g.contiguous().numpy(), F.contiguous().numpy()
        return torch.from_numpy(energetic.stresses(*ctx.inputs))

    @staticmethod
    def backward(ctx, G):
        """Return the gradients of g, and of F at fixed g."""
        gradients = energetic.pull_back(G.contiguous().numpy(), *ctx.inputs)
        return tuple(map(torch.from_numpy, gradients))


class Strains(Function):
    """Trial F (n, 3, 3) and its `Spectrum` -> inputs of a `Contraction` (n, 3)."""

    @staticmethod
    def forward(ctx, F, factors, kind):
        """Return the strains x (n, 3)."""
        ctx.inputs = factors, kind
        return torch.from_numpy(contraction.strains_of(factors, kind))

    @staticmethod
    def backward(ctx, x_bar):
        """Return the gradient of F."""
        gradients = contraction.pull_back_strains(x_bar.contiguous().numpy(), *ctx.inputs)
        return torch.from_numpy(gradients), None, None


class Contracted(Function):
    """c = (a, b) (n, 2), trial F (n, 3, 3) and its `Spectrum` -> F (n, 3, 3)."""

    @staticmethod
    def forward(ctx, c, F, factors):
        """Return F after the return map."""
        ctx.inputs = c.contiguous().numpy(), factors
        return torch.from_numpy(contraction.contracted(*ctx.inputs))

    @staticmethod
    def backward(ctx, G):
        """Return the gradients of c, and of F at fixed c."""
        gradients = contraction.pull_back(G.contiguous().numpy(), *ctx.inputs)
        return *map(torch.from_numpy, gradients), None


class GrowingConvex(nn.Module):
    """Inputs (n, inputs) -> slopes (n, inputs) of a convex function that grows with each of them.

    W = exp(log_W) (in, out) of all layers, softplus between them; the last one has no bias. The
    first layer begins with those shares of inputs.
    """

    def __init__(self, shares, hidden):
        super().__init__()
        sizes = len(shares), *hidden, 1
        self.log_W = nn.ParameterList([
            nn.Parameter(0.5 * torch.randn(n, m, dtype=torch.float64) - (log(n) if k else 0.0))
            for k, (n, m) in enumerate(pairwise(sizes))])
        with torch.no_grad():
            self.log_W[0] += torch.tensor(shares, dtype=torch.float64).log()[:, None]
        self.b = nn.ParameterList([nn.Parameter(torch.zeros(n, dtype=torch.float64))
                                   for n in hidden])

    def forward(self, m):
        """Return the slopes (n, inputs) at inputs m."""
        *inner, last = (log_W.exp() for log_W in self.log_W)
        a, grown = m, []
        for W, b in zip(inner, self.b, strict=True):
            z = a @ W + b
            a = nn.functional.softplus(z)
            grown.append(torch.sigmoid(z))
        g = last.T
        for W, growth in zip(reversed(inner), reversed(grown), strict=True):
            g = (g * growth) @ W.T
        return g

    def layers(self):
        """Return [(W (in, out), b (out,))] as arrays."""
        biases = [*self.b, torch.zeros(1, dtype=torch.float64)]
        return tuple((log_W.detach().exp().numpy().copy(), b.detach().numpy().copy())
                     for log_W, b in zip(self.log_W, biases, strict=True))


    def put(self, layers):
        """Write layers, as those of `layers`."""
        with torch.no_grad():
            for log_W, (W, _) in zip(self.log_W, layers, strict=True):
                log_W.copy_(torch.from_numpy(W).log())
            for b, (_, own) in zip(self.b, layers[:-1], strict=True):
                b.copy_(torch.from_numpy(own))


class EnergyLawModule(LawModule):
    """F (n, 3, 3) -> tau (n, 3, 3) [Pa] of an energy."""

    def __init__(self, kind):
        super().__init__(kind)
        self.net = GrowingConvex(SHARES, HIDDEN["elastic"])

    def forward(self, F):
        """Return tau (n, 3, 3) [Pa]."""
        return self.kind.unit * EnergyStress.apply(self.net(Measures.apply(F)), F)

    def weights(self):
        """Return the `LawWeights` of the law."""
        return LawWeights(self.net.layers(), self.kind)

    def resume(self, weights):
        """Take over the layers of `LawWeights` of the same kind and sizes."""
        self.net.put(weights.layers)
        self.resumed = digest(weights)


class ContractionModule(LawModule):
    """Trial F (n, 3, 3) -> F (n, 3, 3) of less strain."""

    def __init__(self, kind):
        super().__init__(kind)
        self.net = MultilayerPerceptron(contraction.READ, contraction.ANSWERED, HIDDEN["plastic"],
                                        bias=True)
        self.net.double()
        nn.init.constant_(self.net.layers[-1].bias, log(START))

    def forward(self, F):
        """Return F after the return."""
        factors = spectrum(F.detach().numpy())
        c = nn.functional.softplus(self.net(Strains.apply(F, factors, self.kind)))
        return Contracted.apply(c, F, factors)

    def weights(self):
        """Return the `LawWeights` of the law."""
        return LawWeights(tuple(layers_of(self.net)), self.kind)

    def resume(self, weights):
        """Take over the layers of `LawWeights` of the same kind and sizes."""
        put_layers(self.net, weights.layers)
        self.resumed = digest(weights)
