"""NSF, Figure 6: the jelly cube (the paper shows sand) at the points of the training, above; below
the networks at a hundred times as many, and the full-order run of these. From left to right: time.
"""

from validation.ldm.published_bodies import read

from ..common.bodies import View, pictures
from ..common.field_panels import COLOURS, time_row
from ..common.style import shared_scale

NEEDS = ["nsf.fig6"]
ROWS = {"few": ("ours", "points of the training"), "networks": ("ours", "networks, more points"),
        "many": ("true", "full order, more points")}


def scale(results):
    return shared_scale(results, NEEDS[0], "many")


def draw(results):
    states = read(results.folder, NEEDS[0])
    panels = [panel for word, (colour, side) in ROWS.items()
              for panel in time_row(states[word], COLOURS[colour], side)]
    return pictures(panels, View(len(states["few"]), 8.0, 25.0, 15.0))
