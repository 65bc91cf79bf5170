"""NSF, Figure 17: sand steeper than all that was trained, 44 and 55 degrees: full order, and
reduced below each. From left to right: time.
"""

from ._orders import shared
from ._reduced import beside

NEEDS = ["nsf.fig17"]


def scale(results):
    return shared(results, NEEDS[0])


def draw(results):
    return beside(results, NEEDS[0], choice=slice(None))
