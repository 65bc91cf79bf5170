"""NSF, Figure 16: sand, training runs with the smallest and the largest angle of friction."""

from validation.nsf.studies import sand

from ..common.field_panels import RunView, training_range
from ..common.style import shared_scale

NEEDS = ["nsf.sand"]
VIEW = RunView(NEEDS[0], sand, "friction {}°")


def scale(results):
    return shared_scale(results, NEEDS[0])


def draw(results):
    return training_range(results, VIEW)
