"""NCLaw, Figure 2 (d): a small body on an inclined plane (the floor of the scene, whose gravity is
turned; here all is turned back, so that gravity points down). From left to right the start, ours,
laws that thermodynamics admits, the truth. The paper's is of water.
"""

import numpy as np

from validation.ldm.published_bodies import read
from validation.nclaw.tasks import slope

from ..common.bodies import View
from ..common.law_panels import comparison_rows, pictures_by_height, with_end_times
from ..common.splats import Balls
from ..common.state_panels import join_balls
from ..common.style import shared_scale

NEEDS = ["nclaw.slope"]
NAMES = ("water", "jelly", "sand", "plasticine")
WORDS = ("ours", "admissible")
FINENESS = 90       # of the floor: points along its longer side
FLOOR = np.array([0.7, 0.77, 0.86])
VIEW = View(4, turn=60.0, lift=12.0)


def scale(results):
    return shared_scale(results, NEEDS[0])


def draw(results):
    rows = with_end_times(results, NEEDS[0], {name: name for name in NAMES})
    panels = comparison_rows(read(results.folder, NEEDS[0]), rows, WORDS)
    floor = floor_of(panels)
    return pictures_by_height([panel._replace(solid=turned(join_balls([panel.solid, floor])))
                               for panel in panels], VIEW)


def turned(balls):
    """Return balls rotated to axes of which the second is against gravity."""
    up, side = -np.array(slope().gravity), np.array([1.0, 0.0, 0.0])
    up /= np.linalg.norm(up)
    R = np.stack([side, up, np.cross(side, up)])
    return balls._replace(x=balls.x @ R.T, n=balls.n @ R.T)


def floor_of(panels):
    """Return balls right below the part of the floor that bodies are above."""
    x = np.concatenate([panel.solid.x for panel in panels])
    low, high = x.min(axis=0), x.max(axis=0)
    spacing = np.ptp(x[:, ::2], axis=0).max() / FINENESS
    along, across = (np.arange(low[k], high[k] + 1.5 * spacing, spacing) for k in (0, 2))
    X, Z = (a.ravel() for a in np.meshgrid(along, across))
    radius, floor = 0.75 * spacing, slope().walls.low[1] * slope().dx
    places = np.stack([X, np.full(len(X), floor - radius), Z], axis=1)
    return Balls(places, np.tile([0.0, 1.0, 0.0], (len(X), 1)), np.full(len(X), radius),
                 np.tile(FLOOR, (len(X), 1)))
