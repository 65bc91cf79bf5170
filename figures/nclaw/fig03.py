"""NCLaw, Figure 3: a large body of water, and four toys of jelly; from left to right the start, and
at the end ours, laws that thermodynamics admits, the truth.
"""

from validation.ldm.published_bodies import read
from validation.nclaw.other_bodies import METHODS

from ..common.bodies import View
from ..common.law_panels import (
    available,
    comparison_rows,
    pictures_by_height,
    with_end_times,
)
from ..common.style import scales

NEEDS = ["nclaw.fig3"]
ROWS = {"dragon": "a dragon of water", "contact": "four toys of jelly"}


def scale(results):
    return scales(results, NEEDS[0])


def draw(results):
    states, rows = read(results.folder, NEEDS[0]), with_end_times(results, NEEDS[0], ROWS)
    words = available(states, ROWS, METHODS)
    return pictures_by_height(comparison_rows(states, rows, words), View(2 + len(words)))
