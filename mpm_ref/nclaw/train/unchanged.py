"""No return map: the plastic law of baselines that know elasticity alone (NCLAW-eq13)."""

from ...materials import NoFlow
from ...materials.learned.weights import LawWeights
from .kinds import LawOfKind

NO_FLOW = NoFlow()


class Unchanged(LawOfKind):
    """F (n, d, d) as it is; nothing is learned."""

    def __init__(self, kind=NO_FLOW):
        super().__init__(kind)

    def forward(self, F):
        """F."""
        return F

    def trained(self):
        """`LawWeights` without layers."""
        return LawWeights((), self.kind)
