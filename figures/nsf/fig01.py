"""NSF, Figure 1: a cake is cut at several angles; the full-order runs, and below each the reduced
one on samples in the middle. From left to right: time.
"""

from ..common.field_panels import reduced_and_full
from ..common.style import shared_scale

NEEDS = ["nsf.cake"]


def scale(results):
    return shared_scale(results, NEEDS[0])


def draw(results):
    return reduced_and_full(results, NEEDS[0], choice=slice(None), lift=35.0)
