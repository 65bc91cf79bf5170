"""NCLaw, Figure 4 (a) and (b): a duck of jelly on water, and ice cream of plasticine that becomes
sand; from left to right the start, ours at the end, the truth there. Colours: height at the start.
"""

from validation.ldm.published_bodies import read

from ..common.bodies import View, pictures
from ..common.law_panels import comparison_rows
from ..common.style import shared_scale

NEEDS = ["nclaw.fig4"]
ROWS = {"pool": "a duck on water", "melting": "what melts"}


def scale(results):
    return shared_scale(results, NEEDS[0])


def draw(results):
    return pictures(comparison_rows(read(results.folder, NEEDS[0]), ROWS), View(3, 9.0))
