"""NSF, Figure 16: sand, training runs with the smallest and the largest angle of friction. From
left to right: time.
"""

from ..common.field_panels import training_range
from ..common.style import shared_scale

NEEDS = ["nsf.sand"]


def scale(results):
    return shared_scale(results, NEEDS[0])


def draw(results):
    return training_range(results, NEEDS[0])
