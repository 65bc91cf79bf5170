"""NSF, Figure 7: a sand column collapses, with the smallest and the largest angle of friction of
the tests: full order, and reduced below.
"""

from validation.nsf.studies import sand

from ..common.field_panels import RunView, reduced_and_full
from ..common.style import shared_scale

NEEDS = ["nsf.sand"]
VIEW = RunView(NEEDS[0], sand, "friction {}°")


def scale(results):
    return shared_scale(results, NEEDS[0])


def draw(results):
    return reduced_and_full(results, VIEW, choice=slice(None))
