"""NCLaw, Figure 4 (a) and (b): a duck of jelly on water, and ice cream of plasticine that becomes
sand; from left to right the start, ours at the end, the truth there.
"""

from validation.ldm.published_bodies import read

from ..common.bodies import View
from ..common.law_panels import comparison_rows, pictures_by_height, with_end_times
from ..common.style import scales

NEEDS = ["nclaw.fig4"]
ROWS = {"pool": "a duck on water", "melting": "what melts"}


def scale(results):
    return scales(results, NEEDS[0])


def draw(results):
    rows = with_end_times(results, NEEDS[0], ROWS)
    return pictures_by_height(comparison_rows(read(results.folder, NEEDS[0]), rows), View(3))
