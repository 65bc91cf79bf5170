"""The law and the flow of a body, of any laws that were trained and stored."""

from . import neural, stretched
from .weights import BESIDE


def elastic(trained):
    """The law of a `weights.Trained` of stress: neural, in principal stretches, or an identified
    one. Raises ValueError for what gives no stress.
    """
    if type(trained.kind) not in BESIDE["elastic"]:
        return neural.elastic(trained)
    return stretched.elastic(trained) if trained.layers else trained.kind


def plastic(trained):
    """The flow of a `weights.Trained` that gives F: neural, identified, or none. Raises ValueError
    for what gives no F.
    """
    return trained.kind if type(trained.kind) in BESIDE["plastic"] else neural.plastic(trained)
