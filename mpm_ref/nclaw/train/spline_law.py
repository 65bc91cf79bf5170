"""The paper's "spline" baseline as it is trained: values at the knots of f, g, h (see `spline`)."""

import torch
from torch import nn

from ...materials.learned.principal import PAIRS
from ...materials.learned.spline import READINGS, knots
from ...materials.learned.weights import LawWeights
from .principal_laws import PrincipalLaw

START = 1e4         # values begin evenly from -START to START [Pa], as in the authors' release
OTHERS = torch.tensor([[1, 2], [0, 2], [0, 1]])     # axes
I, J = torch.tensor(PAIRS[3]).T


class SplineLawModule(PrincipalLaw):
    """`PrincipalLaw` of splines in 3D, of a kind of `spline`."""

    def __init__(self, kind):
        super().__init__(kind)
        x = knots()
        breaks, origins, basis = map(torch.from_numpy, READINGS[type(kind)](x))
        self.breaks, self.origins, self.basis = breaks.contiguous(), origins.contiguous(), basis
        start = torch.linspace(-START, START, len(x), dtype=torch.float64) / kind.unit
        self.values = nn.Parameter(start[:, None].repeat(1, 3))

    def tables(self):
        """Coefficients (p, 4) of the pieces of f, g, h."""
        return torch.einsum("pmk,kf->fpm", self.basis, self.values)

    def at(self, table, x):
        """A function of x, any shape."""
        k = torch.searchsorted(self.breaks, x)
        t, (c3, c2, c1, c0) = x - self.origins[k], table[k].unbind(-1)
        return ((c3 * t + c2) * t + c1) * t + c0

    def y(self, s):
        """y_i = f(s_i) + sum_j g(s_i s_j) s_j + h(J) J/s_i (n, 3)."""
        f, g, h = self.tables()
        of_pairs = self.at(g, s[:, I] * s[:, J])
        first, second = s[:, OTHERS[:, 0]], s[:, OTHERS[:, 1]]
        areas = of_pairs[:, [0, 0, 1]] * first + of_pairs[:, [1, 2, 2]] * second
        return self.at(f, s) + areas + self.at(h, s.prod(1, keepdim=True)) * first * second

    def trained(self):
        """`LawWeights` of the law: one layer from the knots to f, g, h, without biases."""
        values = self.values.detach().numpy().copy()
        return LawWeights(((values, 0.0 * values[0]),), self.kind)
