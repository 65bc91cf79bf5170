"""NSF, Figure 9: stress of the metal frame, the Frobenius norm of the Kirchhoff stress: full
order, and reduced below.
"""

from validation.nsf.studies import metal

from ..common.field_panels import RunView, stress_panels
from ..common.style import shared_scale

NEEDS = ["nsf.metal"]
VIEW = RunView(NEEDS[0], metal, r"$\xi$ = {}")


def scale(results):
    return shared_scale(results, NEEDS[0])


def draw(results):
    return stress_panels(results, VIEW)
