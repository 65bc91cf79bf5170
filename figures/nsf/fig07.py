"""NSF, Figure 7: a sand column collapses, with the smallest and the largest angle of friction of
the tests [degrees]: full order, and reduced below. From left to right: time.
"""

from ..common.orders import shared
from ..common.reduced import beside

NEEDS = ["nsf.sand"]


def scale(results):
    return shared(results, NEEDS[0])


def draw(results):
    return beside(results, NEEDS[0], choice=slice(None))
