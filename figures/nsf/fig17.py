"""NSF, Figure 17: sand steeper than all that was trained, 44 and 55 degrees: full order, and
reduced below each. From left to right: time.
"""

from ..common.field_panels import reduced_and_full
from ..common.style import shared_scale

NEEDS = ["nsf.fig17"]


def scale(results):
    return shared_scale(results, NEEDS[0])


def draw(results):
    return reduced_and_full(results, NEEDS[0], choice=slice(None))
