"""NSF, Figure 10: toothpaste on brushes of several inclinations [degrees]: full order, and reduced
below each, on samples drawn at random and on such with weights. From left to right: time.
"""

from ..common.orders import shared
from ..common.reduced import beside

NEEDS = ["nsf.toothpaste"]


def scale(results):
    return shared(results, NEEDS[0])


def draw(results):
    return beside(results, NEEDS[0], ("true", "ours", "weighed"), slice(None))
