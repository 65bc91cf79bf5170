"""NSF, Figure 9: stress of the metal frame, the Frobenius norm of the Kirchhoff stress: full
order, and reduced below. From left to right: time.
"""

from ..common.field_panels import stress_panels
from ..common.style import shared_scale

NEEDS = ["nsf.metal"]


def scale(results):
    return shared_scale(results, NEEDS[0])


def draw(results):
    return stress_panels(results, NEEDS[0])
