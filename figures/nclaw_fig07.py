"""NCLaw, Figures 7 and 8: bodies of task (c); from left to right the start, ours half-way, the
truth there. Colours: height at the start.
"""

from validation.ldm.kept_bodies import read

from ._bodies import View, pictures
from ._orders import shared
from ._pairs import sides

NEEDS = ["nclaw.fig7"]
ROWS = {name: name for name in ("jelly", "sand", "plasticine", "water")}


def scale(results):
    return shared(results, NEEDS[0])


def draw(results):
    return pictures(sides(read(results.folder, NEEDS[0]), ROWS), View(3, 9.0))
