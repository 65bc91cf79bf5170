"""NSF, Figure 12: a jelly cube hits a jelly wall: the full-order run, the reduced one with fields
of stress, and the one that knows the map alone. From left to right: time.
"""

from ..common.orders import shared
from ..common.reduced import beside

NEEDS = ["nsf.jelly"]


def scale(results):
    return shared(results, NEEDS[0])


def draw(results):
    return beside(results, NEEDS[0], ("true", "ours", "map"))
