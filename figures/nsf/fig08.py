"""NSF, Figure 8: a metal frame is squeezed and let go, with the smallest and the largest
coefficient of hardening of the tests: full order, and reduced below. From left to right: time.
"""

from ..common.field_panels import reduced_and_full
from ..common.style import shared_scale

NEEDS = ["nsf.metal"]


def scale(results):
    return shared_scale(results, NEEDS[0])


def draw(results):
    return reduced_and_full(results, NEEDS[0], choice=slice(None))
