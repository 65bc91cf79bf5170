"""NSF, Figure 5: bread is torn: the full-order run, the reduced one with fields of stress, and the
one that knows the map alone. From left to right: time.
"""

from ..common.orders import shared
from ..common.reduced import beside

NEEDS = ["nsf.bread"]


def scale(results):
    return shared(results, NEEDS[0])


def draw(results):
    return beside(results, NEEDS[0], ("true", "ours", "map"), turn=0.0, lift=75.0)
