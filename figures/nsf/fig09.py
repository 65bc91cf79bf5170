"""NSF, Figure 9: stress of the metal frame, the Frobenius norm of the Kirchhoff stress: full
order, and reduced below. From left to right: time.
"""

from ..common.orders import shared
from ..common.reduced import stresses

NEEDS = ["nsf.metal"]


def scale(results):
    return shared(results, NEEDS[0])


def draw(results):
    return stresses(results, NEEDS[0])
