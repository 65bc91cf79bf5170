"""NSF, Figure 15: bread, training runs with the smallest and the largest modulus. From left to
right: time.
"""

from ..common.field_panels import training_range
from ..common.style import shared_scale

NEEDS = ["nsf.bread"]


def scale(results):
    return shared_scale(results, NEEDS[0])


def draw(results):
    return training_range(results, NEEDS[0], turn=0.0, lift=75.0)
