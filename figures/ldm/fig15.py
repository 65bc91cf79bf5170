"""LDM, Figure 15: four test runs of the tower at three times, full (white) beside reduced (yellow).
To the left, the speed of the top and its direction: theta, phi.
"""

import numpy as np

from validation.ldm.published_bodies import read

from ..common.bodies import FULL, REDUCED, Panel, View, body, no_balls, pictures, side_by_side
from ..common.state_panels import spacing
from ..common.style import shared_scale

NEEDS = ["ldm.fig15"]
VIEW = View(3, turn=45.0, lift=8.0)


def scale(results):
    return shared_scale(results, NEEDS[0], "ldm.fig15.error")


def draw(results):
    states = read(results.folder, NEEDS[0])
    X, dx, panels = states["X"], spacing(states["X"]), []
    for k, mu in enumerate(states["mu"]):
        for j, t in enumerate(states["t"]):
            x, y = (states[name][k, j - 1] if j else X for name in ("full", "reduced"))
            pair = side_by_side(body(x, FULL, dx), body(y, REDUCED, dx), VIEW)
            panels.append(Panel(pair, no_balls(), "" if k else f"t = {t:.2f} s",
                                "" if j else velocity_text(*mu)))
    return pictures(panels, VIEW)


def velocity_text(r, theta, phi):
    """Return the speed of the top and its direction as text."""
    theta, phi = np.degrees((theta, phi))
    return f"{r:.2f} m/s, {theta:.0f}°, \N{MINUS SIGN}{-phi:.0f}°"
