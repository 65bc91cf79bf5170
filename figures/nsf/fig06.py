"""NSF, Figure 6: the jelly cube (the paper shows sand) at the points of the training, above; below
the networks at a hundred times as many, and the full-order run of these.
"""

import numpy as np

from validation.ldm.published_bodies import read
from validation.nsf.studies import jelly

from ..common.field_panels import COLOURS, RunView, over_time, time_row
from ..common.style import shared_scale

NEEDS = ["nsf.fig6"]
VIEW = RunView(NEEDS[0], jelly)
ROWS = {"few": ("ours", "points of\nthe training"), "networks": ("ours", "networks,\nmore points"),
        "many": ("true", "full order,\nmore points")}


def scale(results):
    return shared_scale(results, NEEDS[0], "many")


def draw(results):
    states = read(results.folder, NEEDS[0])
    panels = [panel for word, (colour, side) in ROWS.items()
              for panel in time_row(states[word], COLOURS[colour], side)]
    return over_time(panels, np.arange(1, 1 + len(states["few"])), VIEW)
