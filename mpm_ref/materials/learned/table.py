"""Table of the learned laws and flows, by the kind that is stored with their weights.

A file of weights may also hold constants that were identified: records of `materials`, which have
no layers and are the law themselves.
"""

from collections.abc import Callable
from itertools import pairwise
from typing import NamedTuple

from ...core.precision import PRECISIONS
from .. import (
    DruckerPrager,
    FixedCorotated,
    Fluid,
    FluidProjection,
    Hencky,
    NoFlow,
    VonMises,
)
from . import (
    contraction,
    energetic,
    network,
    network_adjoint,  # noqa: F401  registers the adjoints of networks
    response,
    spline,
    stretch_network,
)
from .contraction import ANSWERED, READ, Contraction
from .energetic import MEASURES, Energetic
from .invariants import count


class LearnedEntry(NamedTuple):
    """The construction of a law or a flow from weights of a kind."""

    build: Callable         # `LawWeights` -> the record that kernels are compiled for
    ends: frozenset         # {(inputs, outputs)} that the layers may have; empty: no layers
    in_scenes: bool = True  # whether it has a `stiffness`, which a run of a scene needs
    in_single: Callable | None = None   # the same record with layers in single precision


ROTATED = frozenset((count(d), d * d) for d in (2, 3))
PLAIN = ROTATED | frozenset((d * d, d * d) for d in (2, 3))
SINGLE = network.with_single_layers
STRETCHES = LearnedEntry(stretch_network.build_law, frozenset({(2, 2), (3, 3)}), in_scenes=False)
KNOTS = LearnedEntry(spline.build_law, frozenset({(len(spline.knots()), 3)}), in_scenes=False)
IDENTIFIED = LearnedEntry(lambda weights: weights.kind, frozenset(), in_scenes=False)

ELASTIC = {         # kind -> entry
    response.Stress: LearnedEntry(network.build_law, ROTATED, in_single=SINGLE),
    response.SymmetricStress: LearnedEntry(network.build_law, ROTATED, in_single=SINGLE),
    response.PlainStress: LearnedEntry(network.build_law, PLAIN, in_single=SINGLE),
    stretch_network.StretchStress: STRETCHES,
    stretch_network.ReleasedStretchStress: STRETCHES,
    spline.SplineStress: KNOTS,
    spline.ReleasedSplineStress: KNOTS,
    Energetic: LearnedEntry(energetic.build_law, frozenset({(MEASURES, 1)})),
    **dict.fromkeys((FixedCorotated, Hencky, Fluid), IDENTIFIED),
}
PLASTIC = {
    response.Correction: LearnedEntry(network.build_flow, ROTATED, in_single=SINGLE),
    response.PlainCorrection: LearnedEntry(network.build_flow, PLAIN, in_single=SINGLE),
    Contraction: LearnedEntry(contraction.build_flow, frozenset({(READ, ANSWERED)})),
    **dict.fromkeys((NoFlow, DruckerPrager, VonMises, FluidProjection), IDENTIFIED),
}
TABLES = {"elastic": ELASTIC, "plastic": PLASTIC}
KINDS = {kind.__name__: kind for table in TABLES.values() for kind in table}


def learned_law(weights, precision="double"):
    """Return the elastic law of `LawWeights`, with layers in a precision of `core.precision`.

    Raises ValueError for a kind that gives no stress, and for one that has no such precision.
    """
    return _learned(ELASTIC, weights, precision)


def learned_flow(weights, precision="double"):
    """Return the flow of `LawWeights`, as `learned_law`. Raises ValueError for a kind that gives no
    F, and for one that has no such precision.
    """
    return _learned(PLASTIC, weights, precision)


def _learned(table, weights, precision):
    if precision not in PRECISIONS:
        raise ValueError(f"precision = {precision!r}: expected {' or '.join(PRECISIONS)}")
    entry = _entry(table, weights.kind)
    require_sizes(weights, entry.ends)
    law = entry.build(weights)
    if precision == "double":
        return law
    if entry.in_single is None:
        raise ValueError(f'precision = "single": laws of kind {type(weights.kind).__name__} '
                         'compute in double alone; expected "double"')
    return entry.in_single(law)


def require_sizes(weights, ends):
    """Raise ValueError unless the layers of `LawWeights` fit, one to the next, and the first and
    the last to one of the pairs `ends`, if there are any: kernels do not check it.
    """
    sizes = [W.shape for W, _ in weights.layers]
    fits = (all(len(size) == 2 for size in sizes)
            and all(after[0] == before[1] for before, after in pairwise(sizes))
            and all(b.shape == (W.shape[1],) for W, b in weights.layers))
    if ends and not (sizes and fits and (sizes[0][0], sizes[-1][1]) in ends):
        wanted = " or ".join(f"{n} numbers and the last to give {m}" for n, m in sorted(ends))
        raise ValueError(f"a law of kind {type(weights.kind).__name__} with layers of sizes "
                         f"{sizes}: expected each to fit the next, the first to read {wanted}")


def is_identified(part, kind):
    """Return whether the laws of a kind, a class, have constants in place of layers."""
    return kind in TABLES[part] and not TABLES[part][kind].ends


def _entry(table, kind):
    try:
        return table[type(kind)]
    except KeyError:
        raise ValueError(f"a law of kind {type(kind).__name__}: expected "
                         f"{' or '.join(one.__name__ for one in table)}") from None
