"""Laws in principal stretches as they are trained: tau = U diag(y s) U^T, y = y(s).

The paper's "neural" baseline (NCLAW-methods) is a network 3 -> 6 -> 6 -> 3 of s - 1 with ELU and
biases. The work it stands for is isotropic, hence `StretchLaw`; the authors' release reads s in
descending order, hence `ReleasedStretchLaw`, whose stress has no derivative where two stretches are
equal, as they are at rest and after rigid motion (see `principal`). All in doubles.
"""

from itertools import permutations

import torch
from torch import nn
from torch.autograd import Function

from ...materials.learned import principal
from ...materials.learned.invariants import spectrum
from ...materials.learned.weights import LawWeights
from .kinds import LawOfKind
from .perceptron import Perceptron, layers_of

HIDDEN = (6, 6)
MEETING = 1e-4      # of s_i - s_j, below which a_ij is taken at this gap


class Stretches(Function):
    """F (n, d, d), and its `Spectrum` -> s (n, d)."""

    @staticmethod
    def forward(ctx, F, of):
        """s."""
        ctx.of = of
        return torch.from_numpy(of.s)

    @staticmethod
    def backward(ctx, s_bar):
        """Gradient of F."""
        F_bar = principal.pull_back_stretches(s_bar.contiguous().numpy(), ctx.of)
        return torch.from_numpy(F_bar), None


class PrincipalStress(Function):
    """y (n, d) and F (n, d, d), its `Spectrum` and the ratios a_ij (n, pairs) -> tau (n, d, d)."""

    @staticmethod
    def forward(ctx, y, F, of, ratios):
        """tau."""
        ctx.given = y.contiguous().numpy(), ratios.contiguous().numpy(), of
        return torch.from_numpy(principal.stresses(ctx.given[0], of))

    @staticmethod
    def backward(ctx, G):
        """Gradients of y, and of F at fixed y."""
        found = principal.pull_back(G.contiguous().numpy(), *ctx.given)
        return *map(torch.from_numpy, found), None, None


class PrincipalLaw(LawOfKind):
    """F (n, d, d) -> tau (n, d, d) [Pa]; `y` is in units of `kind.unit`, and isotropic."""

    def forward(self, F):
        """tau."""
        of = spectrum(F.detach().numpy())
        s = Stretches.apply(F, of)
        y = self.y(s)
        with torch.no_grad():
            ratios = self.ratios(y, s)
        return self.kind.unit * PrincipalStress.apply(y, F, of, ratios)

    def ratios(self, y, s):
        """a_ij (n, pairs); stretches nearer than MEETING are first moved apart to that."""
        found = []
        for i, j in principal.PAIRS[s.shape[1]]:
            gap = s[:, i] - s[:, j]
            near, ratio = gap < MEETING, (y[:, i] - y[:, j]) / gap
            apart = s[near]
            middle = 0.5 * (apart[:, i] + apart[:, j])
            apart[:, i], apart[:, j] = middle + 0.5 * MEETING, middle - 0.5 * MEETING
            of_apart = self.y(apart)
            ratio[near] = (of_apart[:, i] - of_apart[:, j]) / MEETING
            found.append(ratio)
        return torch.stack(found, dim=1)


class EluPerceptron(Perceptron):
    """A `Perceptron` with ELU between its layers, and biases."""

    def __init__(self, inputs, outputs, hidden):
        super().__init__(inputs, outputs, hidden, bias=True)

    def forward(self, a):
        """Outputs (n, outputs) of inputs (n, inputs)."""
        for layer in self.layers[:-1]:
            a = nn.functional.elu(layer(a))
        return self.layers[-1](a)


class ReleasedStretchLaw(PrincipalLaw):
    """y of a network of s - 1 in descending order; drawn in single precision."""

    def __init__(self, kind, dim=3, hidden=HIDDEN):
        super().__init__(kind)
        self.net = EluPerceptron(dim, dim, hidden).double()

    def y(self, s):
        """What the network gives (n, d)."""
        return self.net(s - 1.0)

    def ratios(self, y, s):
        """a_ij (n, pairs), bounded where stretches are equal."""
        return torch.from_numpy(principal.bounded_ratios(y.numpy(), s.numpy()))

    def trained(self):
        """`LawWeights` of the law."""
        return LawWeights(tuple(layers_of(self.net)), self.kind)


class StretchLaw(ReleasedStretchLaw):
    """y as the mean over all orders of s."""

    ratios = PrincipalLaw.ratios

    def y(self, s):
        """Means over orders p of what the network of s_p gives for each stretch (n, d)."""
        orders = torch.tensor(list(permutations(range(s.shape[1]))))
        given = self.net(s[:, orders] - 1.0)
        return given.gather(2, orders.argsort(1).expand(len(s), -1, -1)).mean(1)
