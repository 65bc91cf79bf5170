"""NSF, Figure 1: a cake is cut at several angles; the ends of the full-order runs, and below
of reduced ones on samples in the middle.
"""

from validation.nsf.studies import cake

from ..common.field_panels import RunView, ends_by_value
from ..common.style import shared_scale

NEEDS = ["nsf.cake"]
VIEW = RunView(NEEDS[0], cake, "cut at {}°", lift=35.0)


def scale(results):
    return shared_scale(results, NEEDS[0])


def draw(results):
    return ends_by_value(results, VIEW)
