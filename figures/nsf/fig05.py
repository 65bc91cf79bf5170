"""NSF, Figure 5: bread is torn: the full-order run, the reduced one with fields of stress, and the
one that knows the map alone. From left to right: time.
"""

from ..common.field_panels import reduced_and_full
from ..common.style import shared_scale

NEEDS = ["nsf.bread"]


def scale(results):
    return shared_scale(results, NEEDS[0])


def draw(results):
    return reduced_and_full(results, NEEDS[0], ("true", "ours", "map"), turn=0.0, lift=75.0)
