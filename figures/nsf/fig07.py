"""NSF, Figure 7: a sand column collapses, with the smallest and the largest angle of friction of
the tests [degrees]: full order, and reduced below. From left to right: time.
"""

from ..common.field_panels import reduced_and_full
from ..common.style import shared_scale

NEEDS = ["nsf.sand"]


def scale(results):
    return shared_scale(results, NEEDS[0])


def draw(results):
    return reduced_and_full(results, NEEDS[0], choice=slice(None))
