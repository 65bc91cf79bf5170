"""NSF, Figure 13: a squishy ball falls onto an incline: the full-order run, the reduced one with
fields of stress, and the one that knows the map alone. From left to right: time.
"""

from ..common.orders import shared
from ..common.reduced import beside

NEEDS = ["nsf.ball"]


def scale(results):
    return shared(results, NEEDS[0])


def draw(results):
    return beside(results, NEEDS[0], ("true", "ours", "map"))
