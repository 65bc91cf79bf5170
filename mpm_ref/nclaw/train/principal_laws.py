"""Laws in principal stretches as they are trained: tau = U diag(y s) U^T, y = y(s).

The paper's "neural" baseline (NCLAW-methods) is a network 3 -> 6 -> 6 -> 3 of s - 1 with ELU and
biases. The work it stands for is isotropic, hence `StretchLawModule`; the authors' release reads s
in descending order, hence `ReleasedStretchLawModule`, whose stress has no derivative where two
stretches are equal, as they are at rest and after rigid motion (see `learned.principal`). The
"spline" baseline learns the values at the knots of f, g, h (see `learned.spline`). All in doubles.
"""

from itertools import permutations

import torch
from torch import nn
from torch.autograd import Function

from ...materials.learned import principal
from ...materials.learned.invariants import spectrum
from ...materials.learned.spline import READINGS, knots
from ...materials.learned.weights import LawWeights
from .neural_laws import LawModule, MultilayerPerceptron, layers_of

HIDDEN = (6, 6)
START = 1e4         # values of splines begin evenly from -START to START [Pa], as in the release
LEAST_GAP = 1e-4      # of s_i - s_j, below which a_ij is taken at this gap
OTHERS = torch.tensor([[1, 2], [0, 2], [0, 1]])     # axes
I, J = torch.tensor(principal.PAIRS[3]).T


class Stretches(Function):
    """F (n, d, d), and its `Spectrum` -> s (n, d)."""

    @staticmethod
    def forward(ctx, F, factors):
        """Return s (n, d)."""
        ctx.factors = factors
        return torch.from_numpy(factors.s)

    @staticmethod
    def backward(ctx, s_bar):
        """Return the gradient of F."""
        F_bar = principal.pull_back_stretches(s_bar.contiguous().numpy(), ctx.factors)
        return torch.from_numpy(F_bar), None


class PrincipalStress(Function):
    """y (n, d) and F (n, d, d), its `Spectrum` and the ratios a_ij (n, pairs) -> tau (n, d, d)."""

    @staticmethod
    def forward(ctx, y, F, factors, ratios):
        """Return tau (n, d, d)."""
        ctx.given = y.contiguous().numpy(), ratios.contiguous().numpy(), factors
        return torch.from_numpy(principal.stresses(ctx.given[0], factors))

    @staticmethod
    def backward(ctx, G):
        """Return the gradients of y, and of F at fixed y."""
        gradients = principal.pull_back(G.contiguous().numpy(), *ctx.given)
        return *map(torch.from_numpy, gradients), None, None


class PrincipalLawModule(LawModule):
    """F (n, d, d) -> tau (n, d, d) [Pa]; `y` is in units of `kind.unit`, and isotropic."""

    def forward(self, F):
        """Return tau (n, d, d) [Pa]."""
        factors = spectrum(F.detach().numpy())
        s = Stretches.apply(F, factors)
        y = self.y(s)
        with torch.no_grad():
            ratios = self.ratios(y, s)
        return self.kind.unit * PrincipalStress.apply(y, F, factors, ratios)

    def ratios(self, y, s):
        """Return a_ij (n, pairs); stretches nearer than MEETING are first moved apart to that."""
        ratios = []
        for i, j in principal.PAIRS[s.shape[1]]:
            gap = s[:, i] - s[:, j]
            near, ratio = gap < LEAST_GAP, (y[:, i] - y[:, j]) / gap
            apart = s[near]
            middle = 0.5 * (apart[:, i] + apart[:, j])
            apart[:, i], apart[:, j] = middle + 0.5 * LEAST_GAP, middle - 0.5 * LEAST_GAP
            of_apart = self.y(apart)
            ratio[near] = (of_apart[:, i] - of_apart[:, j]) / LEAST_GAP
            ratios.append(ratio)
        return torch.stack(ratios, dim=1)


class EluPerceptron(MultilayerPerceptron):
    """A `MultilayerPerceptron` with ELU between its layers, and biases."""

    activation = staticmethod(nn.functional.elu)

    def __init__(self, inputs, outputs, hidden):
        super().__init__(inputs, outputs, hidden, bias=True)


class ReleasedStretchLawModule(PrincipalLawModule):
    """y of a network of s - 1 in descending order; drawn in single precision."""

    def __init__(self, kind, dim=3, hidden=HIDDEN):
        super().__init__(kind)
        self.net = EluPerceptron(dim, dim, hidden).double()

    def y(self, s):
        """Return the outputs (n, d) of the network."""
        return self.net(s - 1.0)

    def ratios(self, y, s):
        """Return a_ij (n, pairs), bounded where stretches are equal."""
        return torch.from_numpy(principal.bounded_ratios(y.numpy(), s.numpy()))

    def weights(self):
        """Return the `LawWeights` of the law."""
        return LawWeights(tuple(layers_of(self.net)), self.kind)


class StretchLawModule(ReleasedStretchLawModule):
    """y as the mean over all orders of s."""

    ratios = PrincipalLawModule.ratios

    def y(self, s):
        """Return means over orders p of what the network of s_p gives for each stretch (n, d)."""
        orders = torch.tensor(list(permutations(range(s.shape[1]))))
        given = self.net(s[:, orders] - 1.0)
        return given.gather(2, orders.argsort(1).expand(len(s), -1, -1)).mean(1)


class SplineLawModule(PrincipalLawModule):
    """`PrincipalLawModule` of splines in 3D, of a kind of `spline`."""

    def __init__(self, kind):
        super().__init__(kind)
        x = knots()
        breaks, origins, basis = map(torch.from_numpy, READINGS[type(kind)](x))
        self.breaks, self.origins, self.basis = breaks.contiguous(), origins.contiguous(), basis
        start = torch.linspace(-START, START, len(x), dtype=torch.float64) / kind.unit
        self.values = nn.Parameter(start[:, None].repeat(1, 3))

    def tables(self):
        """Return the coefficients (p, 4) of the pieces of f, g, h."""
        return torch.einsum("pmk,kf->fpm", self.basis, self.values)

    def value(self, table, x):
        """Return a function of x, any shape."""
        k = torch.searchsorted(self.breaks, x)
        t, (c3, c2, c1, c0) = x - self.origins[k], table[k].unbind(-1)
        return ((c3 * t + c2) * t + c1) * t + c0

    def y(self, s):
        """Return y_i = f(s_i) + sum_j g(s_i s_j) s_j + h(J) J/s_i (n, 3)."""
        f, g, h = self.tables()
        of_pairs = self.value(g, s[:, I] * s[:, J])
        first, second = s[:, OTHERS[:, 0]], s[:, OTHERS[:, 1]]
        areas = of_pairs[:, [0, 0, 1]] * first + of_pairs[:, [1, 2, 2]] * second
        return self.value(f, s) + areas + self.value(h, s.prod(1, keepdim=True)) * first * second

    def weights(self):
        """Return the `LawWeights`: one layer from the knots to f, g, h, without biases."""
        values = self.values.detach().numpy().copy()
        return LawWeights(((values, 0.0 * values[0]),), self.kind)
