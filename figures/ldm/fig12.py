"""LDM, Figure 12: a block pulled and twisted: tracers in a full run of few points, that run, a
reduced run of many on a map that was trained on few, and the full run of many. Colours: distance
from the last.
"""

import numpy as np

from validation.ldm.published_bodies import read

from ..common.bodies import FULL, Panel, View, body, distance_to, no_balls, pictures, shades
from ..common.state_panels import spacing
from ..common.style import shared_scale

NEEDS = ["ldm.fig12"]
TOP = 0.99          # quantile of the distances at which the colours end


def scale(results):
    return shared_scale(results, NEEDS[0])


def draw(results):
    states = read(results.folder, NEEDS[0])
    full, low = states["full"], states["low"]
    off = [1000.0 * distance_to(states[name], full) for name in ("tracers", "reduced")]
    (tracers, reduced), shown = shades(off, "plasma", np.quantile(off, TOP))
    near = spacing(full)
    panels = [Panel(body(states["tracers"], tracers, near), no_balls(), "(a) tracers in (b)"),
              Panel(body(low, FULL, spacing(low)), no_balls(), f"(b) full, {len(low)} points"),
              Panel(body(states["reduced"], reduced, near), no_balls(),
                    f"(c) reduced, {len(full)} points"),
              Panel(body(full, FULL, near), no_balls(), f"(d) full, {len(full)} points")]
    return pictures(panels, View(4), shown, "distance from (d) [mm]")
