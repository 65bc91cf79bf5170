"""NSF, Figure 13: a squishy ball falls onto an incline: the full-order run, the reduced one with
fields of stress, and the one that knows the map alone.
"""

from validation.nsf.studies import ball

from ..common.field_panels import RunView, reduced_and_full
from ..common.style import shared_scale

NEEDS = ["nsf.ball"]
VIEW = RunView(NEEDS[0], ball, "plane at {}°")


def scale(results):
    return shared_scale(results, NEEDS[0])


def draw(results):
    return reduced_and_full(results, VIEW, ("true", "ours", "map"))
