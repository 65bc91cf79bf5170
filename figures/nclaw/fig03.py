"""NCLaw, Figure 3: a large body of water, and four toys of jelly; from left to right the start,
ours at the end, the truth there. Colours: height at the start.
"""

from validation.ldm.published_bodies import read

from ..common.bodies import View, pictures
from ..common.law_panels import comparison_rows
from ..common.style import scales

NEEDS = ["nclaw.fig3"]
ROWS = {"dragon": "a dragon of water", "toys": "four toys of jelly"}


def scale(results):
    return scales(results, NEEDS[0])


def draw(results):
    return pictures(comparison_rows(read(results.folder, NEEDS[0]), ROWS), View(3, 9.0))
