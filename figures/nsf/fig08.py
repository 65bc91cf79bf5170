"""NSF, Figure 8: a metal frame is squeezed and let go, with the smallest and the largest
coefficient of hardening of the tests: full order, and reduced below. From left to right: time.
"""

from ..common.orders import shared
from ..common.reduced import beside

NEEDS = ["nsf.metal"]


def scale(results):
    return shared(results, NEEDS[0])


def draw(results):
    return beside(results, NEEDS[0], choice=slice(None))
