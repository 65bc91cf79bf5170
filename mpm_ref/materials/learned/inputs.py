"""What the first layer of a trained law reads: in words, and in numbers."""

from itertools import product

import numpy as np

from . import contraction, energetic, principal
from .invariants import invariants, spectrum

THETA = "theta = sum_i log s_i"


def words(trained, d):
    """Words (inputs) for what a `weights.Trained` in d dimensions reads; none without a network."""
    kind = type(trained.kind)
    if kind is energetic.Energetic:
        return ["|F|^2 - 3 - 2 log J", "|cof F|^2 - 3 - 4 log J", "(J - 1)^2", "J - 1 - log J"]
    if kind is contraction.Contraction:
        parts = "|log s - theta / 3|", "max(theta, 0)", "max(-theta, 0)"
        return [f"log(1 + {part} / strain), {THETA}" for part in parts]
    if kind in (principal.StretchStress, principal.ReleasedStretchStress):
        return stretches(d)
    if not trained.layers or len(trained.layers) == 1:
        return []
    if reads_F(trained, d):
        return [f"F_{place}" for place in places(d)]
    return [*stretches(d), *(f"(F^T F)_{place}" for place in places(d)), "det F - 1"]


def stretches(d):
    """Words for the stretches, in descending order, without their value at rest."""
    return [f"s_{i} - 1" for i in range(d)]


def places(d):
    """Words for the components of a matrix, row by row, without those of I."""
    return [f"{i}{j} - 1" if i == j else f"{i}{j}" for i, j in product(range(d), repeat=2)]


def reads_F(trained, d):
    """Whether a law reads F - I, and no invariants."""
    return len(trained.layers[0][0]) == d * d


def numbers(trained, F):
    """The same numbers (n, inputs) at F (n, d, d)."""
    n, d, _ = F.shape
    kind, of = trained.kind, spectrum(F)
    if not words(trained, d):
        return np.empty((n, 0))
    if isinstance(kind, energetic.Energetic):
        return energetic.measures_of(F)
    if isinstance(kind, contraction.Contraction):
        return contraction.strains_of(of, kind)
    if isinstance(kind, principal.StretchStress | principal.ReleasedStretchStress):
        return of.s - 1.0
    return (F - np.eye(d)).reshape(n, -1) if reads_F(trained, d) else invariants(F, of)
