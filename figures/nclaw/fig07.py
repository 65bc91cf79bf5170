"""NCLaw, Figures 2 (c), 7 and 8: bodies of task (c); from left to right the start, ours half-way,
the baseline "neural" there, if it was stored, and the truth. Colours: height at the start.
"""

from validation.ldm.published_bodies import read

from ..common.bodies import View, pictures
from ..common.law_panels import available, comparison_rows
from ..common.style import shared_scale

NEEDS = ["nclaw.fig7"]
ROWS = {name: name for name in ("jelly", "sand", "plasticine", "water")}


def scale(results):
    return shared_scale(results, NEEDS[0])


def draw(results):
    states = read(results.folder, NEEDS[0])
    words = available(states, ROWS, ("ours", "neural"))
    columns = 2 + len(words)
    return pictures(comparison_rows(states, ROWS, words), View(columns, 3.0 * columns))
