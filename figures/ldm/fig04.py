"""LDM, Figure 4: all points of the tower, and one draw of samples: near its bottom (blue), near its
top (red) and elsewhere.
"""

import numpy as np
from matplotlib.colors import to_rgb

from validation.ldm.published_bodies import read

from ..common.bodies import FULL, Panel, View, body, flattened, ghost, no_balls, pictures
from ..common.state_panels import spacing
from ..common.style import scales

NEEDS = ["ldm.fig4"]
COLOURS = ("#e8a33d", "#3b5ba5", "#c8473d")     # elsewhere, bottom, top
LARGE = 1.1         # radius of a sample's ball over the spacing of all points


def scale(results):
    return scales(results, NEEDS[0])


def draw(results):
    states = read(results.folder, NEEDS[0])
    X, samples, view = states["X"], states["X"][states["samples"]], View(2, width=6.4)
    paint = np.array([to_rgb(COLOURS[k]) for k in np.arange(1, 3) @ states["held"]])
    large = flattened(body(samples, paint, spacing(X), LARGE), view)
    return pictures([Panel(body(X, FULL, spacing(X)), no_balls(), f"all {len(X)} points"),
                     Panel(large, ghost(X), f"{len(samples)} samples")], view)
