"""NSF, Figure 10: toothpaste on brushes of several inclinations, at the end: full order, and
reduced on samples drawn at random and on such with weights. A note says what share of the points
lies outside of the picture: such a run failed.
"""

from validation.nsf.studies import toothpaste

from ..common.field_panels import RunView, ends_by_value
from ..common.style import shared_scale

NEEDS = ["nsf.toothpaste"]
VIEW = RunView(NEEDS[0], toothpaste, "{}°")


def scale(results):
    return shared_scale(results, NEEDS[0])


def draw(results):
    return ends_by_value(results, VIEW, ("true", "ours", "weighed"))
