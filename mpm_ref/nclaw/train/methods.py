"""The methods that are compared, by name: how their laws begin, and what is stored of them.

    ours            neural laws (NCLAW-alg4)
    spline          splines in principal stretches, no return map
    neural          a network in principal stretches, no return map
    no rotation     ours without R
    no undeformed   ours without the shift to rest, with biases
    labeled         ours, trained by `labeled.train_labeled`
    admissible      an energy and a contraction, which thermodynamics admits
    sys-id          the true laws, see `sysid.known_laws`

All but the last are drawn from a seed, the elastic law first. Of spline and neural there is a
kind as the authors' release has it and one that is better founded (`spline`, `principal`).
"""

from functools import singledispatch

import torch

from ...materials.learned.stretch_network import ReleasedStretchStress, StretchStress
from . import neural_laws
from .ablations import PlainLaw, UnshiftedLaw
from .admissible_laws import ContractionLaw, EnergeticLaw
from .principal_laws import ReleasedStretchLaw, StretchLaw
from .rollout import Laws
from .spline_law import SplineLawModule
from .unchanged import Unchanged

SYS_ID, LABELED = "sys-id", "labeled"
OF_STRETCHES = {StretchStress: StretchLaw, ReleasedStretchStress: ReleasedStretchLaw}


def stretch_law(kind):
    """The law of either kind of `principal`."""
    return OF_STRETCHES[type(kind)](kind)


METHODS = {     # method -> elastic and plastic law of a kind
    "ours": (neural_laws.NeuralLaw, neural_laws.NeuralLaw),
    LABELED: (neural_laws.NeuralLaw, neural_laws.NeuralLaw),
    "spline": (SplineLawModule, Unchanged),
    "neural": (stretch_law, Unchanged),
    "no rotation": (PlainLaw, PlainLaw),
    "no undeformed": (UnshiftedLaw, UnshiftedLaw),
    "admissible": (EnergeticLaw, ContractionLaw),
}


def laws_of(method, seed, elastic, plastic):
    """`Laws` of a method before training, of kinds."""
    torch.manual_seed(seed)
    return Laws(*(make(kind) for make, kind in zip(METHODS[method], (elastic, plastic),
                                                   strict=True)))


@singledispatch
def trained_of(learned):
    """`LawWeights` of a law of any method."""
    return learned.trained()


trained_of.register(neural_laws.NeuralLaw, neural_laws.trained_of)
