"""NSF, Figure 15: bread, training runs with the smallest and the largest modulus. From left to
right: time.
"""

from ..common.orders import shared
from ..common.reduced import ends

NEEDS = ["nsf.bread"]


def scale(results):
    return shared(results, NEEDS[0])


def draw(results):
    return ends(results, NEEDS[0], turn=0.0, lift=75.0)
