"""NSF, Figure 1: a cake is cut at several angles; the full-order runs, and below each the reduced
one on samples in the middle. From left to right: time.
"""

from ..common.orders import shared
from ..common.reduced import beside

NEEDS = ["nsf.cake"]


def scale(results):
    return shared(results, NEEDS[0])


def draw(results):
    return beside(results, NEEDS[0], choice=slice(None), lift=35.0)
