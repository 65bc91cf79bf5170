"""The law and the flow of a body, of any laws that were trained and stored."""

from . import admissible, network, principal_laws
from .weights import BESIDE


def learned_law(trained):
    """The law of a `weights.Trained` of stress: neural, of an energy, in principal stretches, or an
    identified one. Raises ValueError for what gives no stress.
    """
    if type(trained.kind) not in BESIDE["elastic"]:
        return network.elastic(trained)
    made = admissible.MADE.get(type(trained.kind), principal_laws.elastic)
    return made(trained) if trained.layers else trained.kind


def learned_flow(trained):
    """The flow of a `weights.Trained` that gives F: neural, a contraction, identified, or none.
    Raises ValueError for what gives no F.
    """
    if type(trained.kind) not in BESIDE["plastic"]:
        return network.plastic(trained)
    return admissible.MADE[type(trained.kind)](trained) if trained.layers else trained.kind
