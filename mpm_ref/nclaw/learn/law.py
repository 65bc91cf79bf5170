"""A neural law as it is trained: invariants, a network, an answer."""

from torch import nn

from ..invariants import count
from .functions import Answer, Invariants
from .perceptron import HIDDEN, Perceptron


class NeuralLaw(nn.Module):
    """F (n, d, d) -> answers (n, d, d) of a kind of `response` (NCLAW-alg4)."""

    def __init__(self, kind, dim=3, hidden=HIDDEN):
        super().__init__()
        self.kind = kind
        self.net = Perceptron(count(dim), dim * dim, hidden)

    def forward(self, F):
        """The answers."""
        a, R = Invariants.apply(F)
        return Answer.apply(self.net(a), F, R, self.kind)
