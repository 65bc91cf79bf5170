"""NSF, Figure 17: sand steeper than all that was trained, 44 and 55 degrees: full order, and
reduced below each.
"""

from validation.nsf.studies import sand

from ..common.field_panels import RunView, reduced_and_full
from ..common.style import shared_scale

NEEDS = ["nsf.fig17"]
VIEW = RunView(NEEDS[0], sand, "friction {}°")


def scale(results):
    return shared_scale(results, NEEDS[0])


def draw(results):
    return reduced_and_full(results, VIEW, choice=slice(None))
