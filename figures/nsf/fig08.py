"""NSF, Figure 8: a metal frame is squeezed and let go, with the smallest and the largest
coefficient of hardening, xi, of the tests: full order, and reduced below.
"""

from validation.nsf.studies import metal

from ..common.field_panels import RunView, reduced_and_full
from ..common.style import shared_scale

NEEDS = ["nsf.metal"]
VIEW = RunView(NEEDS[0], metal, r"$\xi$ = {}")


def scale(results):
    return shared_scale(results, NEEDS[0])


def draw(results):
    return reduced_and_full(results, VIEW, choice=slice(None))
