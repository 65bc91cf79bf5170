"""NCLaw, Figures 2 (c), 7 and 8: bodies of task (c); from left to right the start, ours half-way,
the baseline "neural" and laws that thermodynamics admits there, if stored, and the truth.
"""

from validation.ldm.published_bodies import read
from validation.nclaw.other_bodies import BASELINE_METHODS

from ..common.bodies import View
from ..common.law_panels import (
    available,
    comparison_rows,
    pictures_by_height,
    with_end_times,
)
from ..common.style import shared_scale

NEEDS = ["nclaw.fig7"]
ROWS = {name: name for name in ("jelly", "sand", "plasticine", "water")}


def scale(results):
    return shared_scale(results, NEEDS[0])


def draw(results):
    states = read(results.folder, NEEDS[0])
    words = available(states, ROWS, BASELINE_METHODS)
    rows = with_end_times(results, NEEDS[0], ROWS)
    return pictures_by_height(comparison_rows(states, rows, words), View(2 + len(words)))
