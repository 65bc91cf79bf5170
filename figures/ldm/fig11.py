"""LDM, Figure 11: the block before it is pulled and twisted, and after that, reduced and full. The
colours are those of cubes at rest.
"""

import numpy as np
from matplotlib.colors import to_rgb

from validation.ldm.published_bodies import read

from ..common.bodies import FULL, REDUCED, Panel, View, body, no_balls, pictures
from ..common.state_panels import spacing
from ..common.style import scales

NEEDS = ["ldm.fig11"]
CUBES = 4           # along the block's longest side


def scale(results):
    return scales(results, NEEDS[0])


def draw(results):
    stored = read(results.folder, NEEDS[0])
    X = stored["X"]
    states = {"before": X, "after, reduced": stored["reduced"], "after, full": stored["full"]}
    panels = [Panel(body(x, chequered(X), spacing(X)), no_balls(), words)
              for words, x in states.items()]
    return pictures(panels, View(3, lift=28.0))


def chequered(X):
    """Return colours (n, 3) by cube."""
    low, side = X.min(axis=0), np.ptp(X, axis=0).max() / CUBES
    odd = ((X - low) // (1.001 * side)).sum(axis=1) % 2
    return np.where(odd[:, None] > 0, to_rgb(FULL), to_rgb(REDUCED))
