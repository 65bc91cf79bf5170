"""Neural laws with a part left out, the paper's ablations (NCLAW-ablation).

`PlainLaw`      "no rotation": reads F - I, 9 numbers in 3D, and answers without R.
`UnshiftedLaw`  "no undeformed": reads s, F^T F and det F as they are, and has biases. The authors'
                release can leave the shift out of the elastic law alone; the text knows no such
                difference, and here both laws go without. Stored, what the shift would take away is
                part of the first layer's biases.
"""

import torch

from ...materials.learned.invariants import count
from ...materials.learned.weights import LawWeights
from .autograd import Answer, Invariants
from .kinds import LawOfKind
from .perceptron import HIDDEN, Perceptron, layers_of


class PlainLaw(LawOfKind):
    """F (n, d, d) -> answers (n, d, d) of `PlainStress` or `PlainCorrection`."""

    def __init__(self, kind, dim=3, hidden=HIDDEN):
        super().__init__(kind)
        self.net = Perceptron(dim * dim, dim * dim, hidden)

    def forward(self, F):
        """The answers."""
        a = (F - torch.eye(F.shape[1], dtype=F.dtype)).flatten(1).float()
        return Answer.apply(self.net(a), F, F, self.kind)

    def trained(self):
        """`LawWeights` of the law."""
        return LawWeights(tuple(layers_of(self.net)), self.kind)


class UnshiftedLaw(LawOfKind):
    """F (n, d, d) -> answers (n, d, d) of a kind of `response`, not zero at rest."""

    def __init__(self, kind, dim=3, hidden=HIDDEN):
        super().__init__(kind)
        self.net = Perceptron(count(dim), dim * dim, hidden, bias=True)
        one = torch.ones(dim)
        self.rest = torch.cat([one, torch.eye(dim).flatten(), one[:1]])

    def forward(self, F):
        """The answers."""
        a, R = Invariants.apply(F)
        return Answer.apply(self.net(a + self.rest), F, R, self.kind)

    def trained(self):
        """`LawWeights` of the law, in numbers that vanish at rest."""
        (W, b), *others = layers_of(self.net)
        return LawWeights(((W, b + self.rest.double().numpy() @ W), *others), self.kind)
