"""A neural law as it is trained: invariants, a network, an answer."""

import torch

from ...materials.learned.invariants import count
from ...materials.learned.weights import LawWeights
from .autograd import Answer, Invariants
from .kinds import LawOfKind
from .perceptron import HIDDEN, Perceptron, layers_of
from .rollout import Laws


class NeuralLaw(LawOfKind):
    """F (n, d, d) -> answers (n, d, d) of a kind of `response` (NCLAW-alg4)."""

    def __init__(self, kind, dim=3, hidden=HIDDEN):
        super().__init__(kind)
        self.net = Perceptron(count(dim), dim * dim, hidden)

    def forward(self, F):
        """The answers."""
        a, R = Invariants.apply(F)
        return Answer.apply(self.net(a), F, R, self.kind)


def neural_laws(seed, elastic, plastic, dim=3):
    """`Laws` before training: the elastic one is drawn first, then the plastic one."""
    torch.manual_seed(seed)
    return Laws(NeuralLaw(elastic, dim), NeuralLaw(plastic, dim))


def trained_of(law):
    """`LawWeights` of a `NeuralLaw`."""
    return LawWeights(tuple(layers_of(law.net)), law.kind)
