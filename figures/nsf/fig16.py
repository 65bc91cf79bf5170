"""NSF, Figure 16: sand, training runs with the smallest and the largest angle of friction. From
left to right: time.
"""

from ..common.orders import shared
from ..common.reduced import ends

NEEDS = ["nsf.sand"]


def scale(results):
    return shared(results, NEEDS[0])


def draw(results):
    return ends(results, NEEDS[0])
