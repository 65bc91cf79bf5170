"""NSF, Figure 10: toothpaste on brushes of several inclinations [degrees]: full order, and reduced
below each, on samples drawn at random and on such with weights. From left to right: time.
"""

from ..common.field_panels import reduced_and_full
from ..common.style import shared_scale

NEEDS = ["nsf.toothpaste"]


def scale(results):
    return shared_scale(results, NEEDS[0])


def draw(results):
    return reduced_and_full(results, NEEDS[0], ("true", "ours", "weighed"), slice(None))
