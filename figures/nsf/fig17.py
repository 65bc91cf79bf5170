"""NSF, Figure 17: sand steeper than all that was trained, 44 and 55 degrees: full order, and
reduced below each. From left to right: time.
"""

from ..common.orders import shared
from ..common.reduced import beside

NEEDS = ["nsf.fig17"]


def scale(results):
    return shared(results, NEEDS[0])


def draw(results):
    return beside(results, NEEDS[0], choice=slice(None))
